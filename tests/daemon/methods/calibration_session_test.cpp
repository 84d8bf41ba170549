#include "abbe/methods/calibration_session.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <optional>

#include "abbe/methods/otf/inputs.hpp"
#include "abbe/pipeline/environment_use.hpp"
#include "session_drive.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using protocol::HostTime;
using Drive = test::SessionDrive;
using ::testing::ElementsAre;
using ::testing::StartsWith;

const std::vector<AxisPosition> kPath{{0, 0, 0}, {0.1, 0, 0}, {0.1, 0.1, 0}, {0.1, 0.1, 0.1}};

TEST(CalibrationSession, GoesThroughItsStatesAlongThePath) {
  CalibrationSession session;
  ASSERT_TRUE(session.start({OtfRequest{kPath}, HostTime{10s}}));
  Drive drive{session};
  drive.stand(kPath[0], 1s);
  EXPECT_EQ(session.status().state, SessionState::Warming);
  for (std::size_t i = 1; i < kPath.size(); ++i) drive.move(kPath[i]);
  EXPECT_EQ(session.status().state, SessionState::Acquiring);
  drive.stand(kPath.back(), 2s);
  EXPECT_EQ(session.status().state, SessionState::Identifying);
}

/// The reasons of the events so far.
std::vector<std::string> reasons_of(CalibrationSession& session) {
  std::vector<std::string> reasons;
  for (const SessionEvent& event : session.take_events()) reasons.push_back(event.status.reason);
  return reasons;
}

TEST(CalibrationSession, ReportsWhenTheMachineMayDriveOff) {
  CalibrationSession session;
  ASSERT_TRUE(session.start({OtfRequest{kPath}, HostTime{10s}}));
  Drive drive{session};
  drive.stand({0.05, 0.05, 0}, 1s);
  ASSERT_TRUE(session.status().start);
  EXPECT_FALSE(session.status().start->ready);
  drive.stand(kPath[0], 1s);
  EXPECT_TRUE(session.status().start->ready);
  EXPECT_THAT(reasons_of(session), ElementsAre(StartsWith("waiting for the machine to stand"),
                                               "READY: drive the path now"));
  drive.move(kPath[1]);
  EXPECT_FALSE(session.status().start);
  EXPECT_THAT(reasons_of(session), ElementsAre("driving the path"));
}

TEST(CalibrationSession, ReportsThatTheRunBeganBeforeReady) {
  CalibrationSession session;
  ASSERT_TRUE(session.start({OtfRequest{kPath}, HostTime{10s}}));
  Drive drive{session};
  drive.unsettle_clock(true);
  drive.stand(kPath[0], 1s);
  EXPECT_FALSE(session.status().start->ready);
  drive.move(kPath[1]);
  EXPECT_EQ(session.status().state, SessionState::Acquiring);
  EXPECT_THAT(reasons_of(session).back(),
              StartsWith("driving the path, begun before READY: the clock of the tracker"));
}

TEST(CalibrationSession, ReportsAtOnceThatTheStartWasMissed) {
  CalibrationSession session;
  ASSERT_TRUE(session.start({OtfRequest{kPath}, HostTime{10s}}));
  Drive drive{session};
  drive.stand(kPath[0], 100ms);
  drive.move({0.02, 0, 0});
  ASSERT_EQ(session.status().state, SessionState::Warming);
  EXPECT_TRUE(session.status().start->missed);
  EXPECT_THAT(reasons_of(session),
              ElementsAre(StartsWith("waiting"), StartsWith("start missed: the machine has left")));
}

std::string reason_of_a_run_along(const std::vector<AxisPosition>& file,
                                  const AcquisitionOptions& options = {}) {
  CalibrationSession session{{options, {}, {}}};
  EXPECT_TRUE(session.start({OtfRequest{file}, HostTime{10s}}));
  Drive drive{session};
  drive.stand(kPath[0], 1s);
  for (std::size_t i = 1; i < kPath.size(); ++i) {
    drive.move(kPath[i]);
    drive.stand(kPath[i], i + 1 < kPath.size() ? 100ms : 2s);
  }
  return session.status().state == SessionState::Refused ? session.status().reason : "";
}

TEST(CalibrationSession, ScalesThatContradictAVertexEndTheRun) {
  auto file = kPath;
  file[2][1] += 0.4e-3;
  const std::string reason = reason_of_a_run_along(file);
  EXPECT_NE(
      reason.find("at vertex 2 Y reads 100.000 mm, the path has 100.400 mm, 0.020 mm allowed"),
      std::string::npos)
      << reason;
}

TEST(CalibrationSession, ScalesThatContradictAPathOfAnotherSizeEndTheRun) {
  auto file = kPath;
  for (AxisPosition& q : file)
    for (double& x : q) x *= 0.999;
  EXPECT_NE(reason_of_a_run_along(file).find("at vertex 1 X reads 100.000 mm"), std::string::npos);
}

TEST(CalibrationSession, AMachineMayDeviateFromItsCommandByTheTolerance) {
  auto file = kPath;
  file[3][2] += 15e-6;
  EXPECT_EQ(reason_of_a_run_along(file), "");
  EXPECT_NE(reason_of_a_run_along(file, {.reading_tolerance_m = 10e-6}), "");
}

TEST(CalibrationSession, TheRunBeginsAndEndsInStandstill) {
  CalibrationSession session;
  ASSERT_TRUE(session.start({OtfRequest{kPath}, HostTime{10s}}));
  Drive drive{session};
  drive.stand(kPath[0], 5s);
  for (std::size_t i = 1; i < kPath.size(); ++i) drive.move(kPath[i]);
  drive.stand(kPath.back(), 2s);
  auto acquired = session.take_run();

  ASSERT_TRUE(acquired);
  const CalibrationRun taken = run_of(std::move(*acquired));
  const std::vector<RunPoint>* run = &std::get<OtfRun>(taken).points;
  ASSERT_GT(run->size(), 1000u);
  EXPECT_EQ((*run)[19].p_tracker_m, kPath[0]);
  EXPECT_EQ((*run)[run->size() - 20].p_tracker_m, kPath.back());
  EXPECT_LT(
      run->size(),
      3000u + 2u * 200u + 10u);  // 300 mm at 0.1 mm each, and 0.4 s of standstill at either end
}

TEST(CalibrationSession, EverySessionHasANumberOfItsOwn) {
  CalibrationSession session;
  EXPECT_EQ(session.status().id, 0u);
  ASSERT_TRUE(session.start({OtfRequest{kPath}, HostTime{10s}}));
  EXPECT_EQ(session.status().id, 1u);
  EXPECT_FALSE(session.start({OtfRequest{kPath}, HostTime{10s}}));
  ASSERT_TRUE(session.cancel("anna", HostTime{11s}));
  EXPECT_EQ(session.status().id, 1u);
  ASSERT_TRUE(session.start({OtfRequest{kPath}, HostTime{12s}}));
  EXPECT_EQ(session.status().id, 2u);
}

TEST(CalibrationSession, AMachineThatRepeatsItsPathEndsTheRunAtThePointLimit) {
  AcquisitionOptions options;
  options.most_points = 5000;
  CalibrationSession session{{options, {}, {}}};
  ASSERT_TRUE(session.start({OtfRequest{kPath}, HostTime{10s}}));
  Drive drive{session};
  drive.stand(kPath[0], 1s);
  for (int cycle = 0; cycle < 4; ++cycle)
    for (const std::size_t vertex : {1u, 0u}) drive.move(kPath[vertex]);
  EXPECT_EQ(session.status().state, SessionState::Refused);
  EXPECT_NE(session.status().reason.find("5000 tracker points and does not end"), std::string::npos)
      << session.status().reason;
}

TEST(CalibrationSession, TheRunContainsTheTemperaturesOfScalesAndAir) {
  AcquisitionOptions options;
  constexpr double kAlpha = 10e-6, kFixed_m = -0.05;
  options.environment.thermal = {{0, {.axis = "X", .alpha_per_K = kAlpha, .fixed_m = kFixed_m}}};
  options.environment.air.assumed_index = 1.00027;
  CalibrationSession session{{options, {}, {}}};
  ASSERT_TRUE(session.start({OtfRequest{kPath}, HostTime{10s}}));
  Drive drive{session};
  protocol::EnvironmentSample warm;
  warm.air_temperature_K = 294.0;
  warm.air_pressure_Pa = 101'000.0;
  warm.relative_humidity = 0.4;
  warm.temperature_K[0] = 293.15 + 5.0;
  drive.set_environment(warm);
  drive.stand(kPath[0], 1s);
  for (std::size_t i = 1; i < kPath.size(); ++i) drive.move(kPath[i]);
  drive.stand(kPath.back(), 2s);
  auto acquired = session.take_run();
  ASSERT_TRUE(acquired);
  const CalibrationRun taken = run_of(std::move(*acquired));
  const auto& run = std::get<OtfRun>(taken);

  for (std::size_t i = 0; i < kPath.size(); ++i) {
    EXPECT_NEAR(run.path_m[i][0] - kPath[i][0], 5.0 * kAlpha * (kPath[i][0] - kFixed_m), 1e-12);
    EXPECT_EQ(run.path_m[i][1], kPath[i][1]);
  }

  EXPECT_NEAR(run.u_scale, 2e-7, 0.3e-7);  // 0.2 K: 1.9e-7, 30 Pa: 0.8e-7
}

TEST(CalibrationSession, TheRunContainsTheUncertaintyLeftByTheControllersAirCorrection) {
  Config config;
  config.of<TrackerConfig>().emplace();
  AcquisitionOptions options;
  options.environment = environment_use(config);
  CalibrationSession session{{options, {}, {}}};

  ASSERT_TRUE(session.start({OtfRequest{kPath}, HostTime{10s}}));
  Drive drive{session};
  drive.stand(kPath[0], 1s);
  for (std::size_t i = 1; i < kPath.size(); ++i) drive.move(kPath[i]);
  drive.stand(kPath.back(), 2s);
  auto acquired = session.take_run();
  ASSERT_TRUE(acquired);
  const CalibrationRun taken = run_of(std::move(*acquired));
  EXPECT_NEAR(std::get<OtfRun>(taken).u_scale, TrackerConfig::kControllersAir, 1e-18);
}

TEST(CalibrationSession, TheRunNamesAirThatIsNotMeasured) {
  Config config;
  config.of<TrackerConfig>().emplace().weather = WeatherConfig::None;
  AcquisitionOptions options;
  options.environment = environment_use(config);
  CalibrationSession session{{options, {}, {}}};

  ASSERT_TRUE(session.start({OtfRequest{kPath}, HostTime{10s}}));
  Drive drive{session};
  drive.stand(kPath[0], 1s);
  for (std::size_t i = 1; i < kPath.size(); ++i) drive.move(kPath[i]);
  drive.stand(kPath.back(), 2s);
  auto acquired = session.take_run();
  ASSERT_TRUE(acquired);
  const CalibrationRun taken = run_of(std::move(*acquired));
  EXPECT_THAT(std::get<OtfRun>(taken).unmeasured_air.value_or(""),
              testing::HasSubstr("air not measured"));
}

TEST(CalibrationSession, TheStandstillOfASlowTrackerLastsTwentyPoints) {
  Config config;
  config.of<TrackerConfig>().emplace().point_rate_hz = 10.0;
  const auto options = acquisition_options(config);
  EXPECT_GE(options.stand_before / 100ms, 20);
  EXPECT_GE(options.keep_before, options.stand_before);
  EXPECT_GE(options.stand_after, options.keep_after);
  config.of<TrackerConfig>()->point_rate_hz = 500.0;
  EXPECT_EQ(acquisition_options(config).stand_before, AcquisitionOptions{}.stand_before);
}

TEST(CalibrationSession, ATooShortStandstillAtTheStartIsTheReasonGiven) {
  Config config;
  config.of<TrackerConfig>().emplace().point_rate_hz = 5.0;
  CalibrationSession session{{acquisition_options(config), {}, {}}};
  ASSERT_TRUE(session.start({OtfRequest{kPath}, HostTime{10s}}));
  Drive drive{session};
  drive.stand(kPath[0], 1s);
  EXPECT_THAT(session.status().reason, testing::HasSubstr("mm for 4.0 s"));

  drive.move(kPath[1]);
  drive.pause(1h);
  drive.stand(kPath[1], 1s);
  EXPECT_THAT(session.status().reason,
              AllOf(testing::HasSubstr("did not stand at (0.000, 0.000, 0.000) mm for 4.0 s"),
                    testing::HasSubstr("the longest time was 1.0 s")));
}

TEST(CalibrationSession, AMachineThatStaysAtTheStartIsTheReasonGiven) {
  AcquisitionOptions options;
  options.wait_for_start = 5s;
  CalibrationSession session{{options, {}, {}}};
  ASSERT_TRUE(session.start({OtfRequest{kPath}, HostTime{10s}}));
  Drive drive{session};
  drive.stand(kPath[0], 6s);
  EXPECT_THAT(session.status().reason, testing::HasSubstr("did not drive off from (0.000"));
}

TEST(CalibrationSession, RefusesWhenAnotherPathIsDriven) {
  CalibrationSession session;
  ASSERT_TRUE(session.start({OtfRequest{kPath}, HostTime{10s}}));
  Drive drive{session};
  drive.stand(kPath[0], 1s);
  drive.move({0, 0.1, 0});
  EXPECT_EQ(session.status().state, SessionState::Refused);
  EXPECT_NE(session.status().reason.find("another path"), std::string::npos)
      << session.status().reason;
}

TEST(CalibrationSession, ABeamLostAroundACornerDoesNotLoseThePath) {
  CalibrationSession session;
  ASSERT_TRUE(session.start({OtfRequest{kPath}, HostTime{10s}}));
  Drive drive{session};
  drive.stand(kPath[0], 1s);
  drive.move({0.08, 0, 0});
  drive.pause(3s);
  drive.jump({0.1, 0.02, 0});
  drive.move(kPath[2]);
  drive.move(kPath[3]);
  drive.stand(kPath.back(), 2s);
  EXPECT_EQ(session.status().state, SessionState::Identifying) << session.status().reason;
}

TEST(CalibrationSession, ShortLegsAtTheEndThatNoPointFellOnDoNotKeepTheRunGoing) {
  auto path = kPath;
  for (const double z : {0.103, 0.106, 0.109}) path.push_back({0.1, 0.1, z});
  CalibrationSession session;
  ASSERT_TRUE(session.start({OtfRequest{path}, HostTime{10s}}));
  Drive drive{session};
  drive.stand(path[0], 1s);
  for (std::size_t i = 1; i < kPath.size(); ++i) drive.move(path[i]);
  drive.jump(path.back());
  drive.stand(path.back(), 2s);
  EXPECT_EQ(session.status().state, SessionState::Identifying) << session.status().reason;
}

TEST(CalibrationSession, AClockMappingThatJumpsBackDoesNotAddPathLength) {
  CalibrationSession session;
  ASSERT_TRUE(session.start({OtfRequest{kPath}, HostTime{10s}}));
  Drive drive{session};
  drive.stand(kPath[0], 1s);

  for (std::size_t i = 1; i < kPath.size(); ++i) {
    drive.move(kPath[i]);
    const AxisPosition corner = kPath[i];
    const AxisPosition back{corner[0] - 0.1 * (corner[0] - kPath[i - 1][0]),
                            corner[1] - 0.1 * (corner[1] - kPath[i - 1][1]),
                            corner[2] - 0.1 * (corner[2] - kPath[i - 1][2])};
    for (int k = 0; k < 5; ++k) {
      drive.jump(back);
      drive.move(corner);
    }
  }

  drive.stand(kPath.back(), 2s);
  EXPECT_EQ(session.status().state, SessionState::Identifying) << session.status().reason;
}

TEST(CalibrationSession, RefusesWhenTheBeamStaysLost) {
  CalibrationSession session;
  ASSERT_TRUE(session.start({OtfRequest{kPath}, HostTime{10s}}));
  Drive drive{session};
  drive.stand(kPath[0], 1s);
  drive.move(kPath[1]);
  drive.pause(40s);
  drive.move(kPath[2]);
  EXPECT_EQ(session.status().state, SessionState::Refused);
  EXPECT_NE(session.status().reason.find("no tracker point for 40.0 s"), std::string::npos)
      << session.status().reason;
}

TEST(CalibrationSession, WaitsInWallTimeForASimulatorFasterThanRealTime) {
  Config config;
  config.daemon.speed = 20.0;
  EXPECT_EQ(acquisition_options(config).arrival_time_out,
            20 * AcquisitionOptions{}.arrival_time_out);
}

TEST(CalibrationSession, LeavesOutPointsThatCameOutOfOrder) {
  CalibrationSession session;
  ASSERT_TRUE(session.start({OtfRequest{kPath}, HostTime{10s}}));
  Drive drive{session};
  drive.stand(kPath[0], 1s);
  drive.move(kPath[1]);
  drive.set_device_clock(499900ms);  // one packet, 100 ms old by the tracker's own clock
  drive.stand(kPath[1], 50ms);
  drive.set_device_clock(500s);
  for (std::size_t i = 2; i < kPath.size(); ++i) drive.move(kPath[i]);
  drive.stand(kPath.back(), 2s);

  EXPECT_NE(session.status().reason.find("25 out of order left out"), std::string::npos)
      << session.status().reason;
  auto acquired = session.take_run();
  ASSERT_TRUE(acquired);
  const CalibrationRun taken = run_of(std::move(*acquired));
  const std::vector<RunPoint>* run = &std::get<OtfRun>(taken).points;
  for (std::size_t i = 1; i < run->size(); ++i)
    ASSERT_GT((*run)[i].device_time, (*run)[i - 1].device_time);
}

TEST(CalibrationSession, RefusesWhenTheTrackersClockRestarts) {
  CalibrationSession session;
  ASSERT_TRUE(session.start({OtfRequest{kPath}, HostTime{10s}}));
  Drive drive{session};
  drive.stand(kPath[0], 1s);
  drive.move(kPath[1]);
  drive.set_device_clock(0s);
  drive.move(kPath[2]);
  EXPECT_EQ(session.status().state, SessionState::Refused);
  EXPECT_NE(session.status().reason.find("clock restarted"), std::string::npos)
      << session.status().reason;
}

TEST(CalibrationSession, KeepsWaitingWhenTheTrackersClockRestartsBeforeTheRun) {
  CalibrationSession session;
  ASSERT_TRUE(session.start({OtfRequest{kPath}, HostTime{10s}}));
  Drive drive{session};
  drive.stand(kPath[0], 1s);
  drive.set_device_clock(0s);
  drive.stand(kPath[0], 1s);
  drive.move(kPath[1]);
  EXPECT_EQ(session.status().state, SessionState::Acquiring) << session.status().reason;
}

TEST(CalibrationSession, EndsWhenNoPointArrivesAnyMore) {
  CalibrationSession session;
  ASSERT_TRUE(session.start({OtfRequest{kPath}, HostTime{10s}}));
  Drive drive{session};
  drive.stand(kPath[0], 1s);
  drive.move(kPath[1]);
  session.tick(drive.now() + 30s);  // a backlog may still come
  EXPECT_EQ(session.status().state, SessionState::Acquiring);
  session.tick(drive.now() + 41s);
  EXPECT_EQ(session.status().state, SessionState::Refused);
  EXPECT_NE(session.status().reason.find("no tracker point"), std::string::npos)
      << session.status().reason;
}

TEST(CalibrationSession, WaitsForALimitedTimeForStandstillAtTheStart) {
  CalibrationSession silent, elsewhere;
  ASSERT_TRUE(silent.start({OtfRequest{kPath}, HostTime{10s}}));
  silent.tick(HostTime{10s} + 59min);
  EXPECT_EQ(silent.status().state, SessionState::Warming);
  silent.tick(HostTime{10s} + 61min);
  EXPECT_EQ(silent.status().state, SessionState::Refused);

  ASSERT_TRUE(elsewhere.start({OtfRequest{kPath}, HostTime{10s}}));
  Drive drive{elsewhere};
  drive.stand(kPath[1], 1s);
  drive.pause(1h);
  drive.stand(kPath[1], 1s);
  EXPECT_EQ(elsewhere.status().state, SessionState::Refused);
  EXPECT_NE(elsewhere.status().reason.find("did not stand at"), std::string::npos)
      << elsewhere.status().reason;
}

TEST(CalibrationSession, RefusesWhenTheMachineStopsForGood) {
  CalibrationSession session;
  ASSERT_TRUE(session.start({OtfRequest{kPath}, HostTime{10s}}));
  Drive drive{session};
  drive.stand(kPath[0], 1s);
  drive.move({0.05, 0, 0});
  for (int i = 0; i < 60; ++i) {  // a point now and then: the tracker continues
    drive.pause(20s);
    drive.stand({0.05, 0, 0}, Drive::kPeriod);
  }
  EXPECT_EQ(session.status().state, SessionState::Refused);
  EXPECT_NE(session.status().reason.find("stood still"), std::string::npos)
      << session.status().reason;
}

TEST(CalibrationSession, RefusesWhenTheAxesStayMissing) {
  CalibrationSession session;
  ASSERT_TRUE(session.start({OtfRequest{kPath}, HostTime{10s}}));
  Drive drive{session};
  drive.stand(kPath[0], 1s);
  drive.move(kPath[1]);
  drive.lose_axes();
  drive.stand(kPath[1], 31s);
  EXPECT_EQ(session.status().state, SessionState::Refused);
  EXPECT_NE(session.status().reason.find("no axis positions"), std::string::npos)
      << session.status().reason;
}

TEST(CalibrationSession, IgnoresSamplesFromBeforeItsStart) {
  CalibrationSession session;
  ASSERT_TRUE(session.start({OtfRequest{kPath}, HostTime{60s}}));
  Drive drive{session};
  drive.stand(kPath[0], 1s);
  drive.move(kPath[1]);
  EXPECT_EQ(session.status().state, SessionState::Warming);
}

TEST(CalibrationSession, ASecondStartWhileRunningIsRefused) {
  CalibrationSession session;
  ASSERT_TRUE(session.start({OtfRequest{kPath}, HostTime{10s}}));
  const auto second = session.start({OtfRequest{kPath}, HostTime{11s}});
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::Refused);
}

TEST(CalibrationSession, TheVerdictEndsItActiveOrRefusedAndLeavesItsTrack) {
  for (const bool passed : {true, false}) {
    CalibrationSession session;
    ASSERT_TRUE(session.start({OtfRequest{kPath}, HostTime{10s}}));
    Drive drive{session};
    drive.stand(kPath[0], 1s);
    for (std::size_t i = 1; i < kPath.size(); ++i) drive.move(kPath[i]);
    drive.stand(kPath.back(), 2s);
    ASSERT_TRUE(session.take_run());
    session.identified({}, drive.now());
    session.judged("model", passed, "verdict", {}, drive.now());
    std::vector<SessionState> track;
    for (const auto& event : session.take_events()) track.push_back(event.status.state);
    // READY is an event of its own.
    EXPECT_EQ(track,
              (std::vector{SessionState::Warming, SessionState::Warming, SessionState::Acquiring,
                           SessionState::Identifying, SessionState::Judged,
                           passed ? SessionState::Active : SessionState::Refused}));
  }
}

TEST(CalibrationSession, TheIdentificationOfACancelledSessionEndsBeforeTheNextStarts) {
  CalibrationSession session;
  ASSERT_TRUE(session.start({OtfRequest{kPath}, HostTime{10s}}));
  Drive drive{session};
  drive.stand(kPath[0], 1s);
  for (std::size_t i = 1; i < kPath.size(); ++i) drive.move(kPath[i]);
  drive.stand(kPath.back(), 2s);
  ASSERT_TRUE(session.take_run());
  ASSERT_TRUE(session.cancel("anna", drive.now()));
  EXPECT_EQ(session.status().state, SessionState::Refused);

  const auto early = session.start({OtfRequest{kPath}, drive.now()});
  ASSERT_FALSE(early);
  EXPECT_THAT(early.error().text, testing::HasSubstr("is still ending"));
  session.not_identified({ErrorCode::Refused, "stopped"}, drive.now());
  EXPECT_EQ(session.status().reason, "cancelled by anna");
  EXPECT_TRUE(session.start({OtfRequest{kPath}, drive.now()}));
}

TEST(CalibrationSession, AModelThatIsBeingStoredIsNotCancelled) {
  CalibrationSession session;
  ASSERT_TRUE(session.start({OtfRequest{kPath}, HostTime{10s}}));
  Drive drive{session};
  drive.stand(kPath[0], 1s);
  for (std::size_t i = 1; i < kPath.size(); ++i) drive.move(kPath[i]);
  drive.stand(kPath.back(), 2s);
  ASSERT_TRUE(session.take_run());
  session.identified({}, drive.now());
  EXPECT_FALSE(session.cancel("anna", drive.now()));
  EXPECT_EQ(session.stage(), SessionStage::Storing);

  session.store_failed("model 0123 is not stored", "tried again", drive.now());
  EXPECT_EQ(session.status().reason, "model 0123 is not stored; tried again");
  EXPECT_TRUE(session.cancel("anna", drive.now()));
  EXPECT_EQ(session.not_stored(), "");
}

TEST(CalibrationSession, CancelEndsARunningSessionOnly) {
  CalibrationSession session;
  EXPECT_FALSE(session.cancel("operator", HostTime{1s}));
  ASSERT_TRUE(session.start({OtfRequest{kPath}, HostTime{10s}}));
  ASSERT_TRUE(session.cancel("operator", HostTime{11s}));
  EXPECT_EQ(session.status().state, SessionState::Refused);
  EXPECT_TRUE(session.start({OtfRequest{kPath}, HostTime{12s}}));
}

}  // namespace
}  // namespace abbe::daemon
