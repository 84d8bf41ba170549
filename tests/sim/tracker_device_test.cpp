#include "abbe/sim/tracker_device.hpp"

#include <gmock/gmock.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

#include "tracker_script.hpp"

namespace abbe::sim {
namespace {

using namespace std::chrono_literals;
using emscon::Status;
using test::TrackerScript;
using testing::Contains;
using testing::Field;
using testing::Not;

Eigen::Vector3d position_m(const emscon::MultiPoint& p) {
  return 1e-3 * Eigen::Vector3d(p.value[0], p.value[1], p.value[2]);
}

std::vector<double> burst_gaps_ms(const std::vector<test::Burst>& bursts) {
  std::vector<double> gaps;
  for (std::size_t i = 1; i < bursts.size(); ++i) {
    gaps.push_back(1e3 * ns_to_seconds(bursts[i].arrival - bursts[i - 1].arrival));
  }
  std::sort(gaps.begin(), gaps.end());
  return gaps;
}

double rms(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double v : values) sum += v * v;
  return std::sqrt(sum / static_cast<double>(values.size()));
}

TEST(TrackerDevice, AnswersEveryCommandThatADriverSendsBeforeStreaming) {
  const VirtualMachine machine = test::standing_machine();
  TrackerScript script(machine);
  const std::vector<emscon::Request> way{
      emscon::GetSystemStatus{},
      emscon::SetUnits{},
      emscon::SetSystemSettings{},
      emscon::SetEnvironmentParams{},
      emscon::Initialize{},
      emscon::GetReflectors{},
      emscon::SetReflector{0},
      emscon::GoBirdBath{},
      emscon::SetStationOrientation{},
      emscon::SetTransformation{},
      emscon::SetCoordinateSystemType{},
      emscon::SetStatisticMode{},
      emscon::SetMeasurementMode{emscon::MeasurementMode::ContinuousTime},
      emscon::SetContinuousTimeModeParams{2, 0, false, {}},
      emscon::SetLongSystemParameter{emscon::LongParameter::TcpDataPacketRate, 10},
      emscon::StartMeasurement{}};

  for (const emscon::Request& request : way) {
    EXPECT_EQ(script.ask(request), Status::Ok) << emscon::name_of(command_of(request));
    EXPECT_EQ(command_of(script.answers.back()), command_of(request));
  }

  script.run(1s);
  EXPECT_FALSE(script.bursts.empty());
  EXPECT_EQ(script.ask(emscon::StopMeasurement{}), Status::Ok);
  EXPECT_FALSE(script.device.streaming());
}

TEST(TrackerDevice, SearchesForAReflectorAndReportsWhenThereIsNone) {
  const VirtualMachine machine = test::standing_machine();
  TrackerScript script(machine);

  EXPECT_EQ(script.ask(emscon::FindReflector{2500.0}), Status::TrackerNotInitialized);
  ASSERT_EQ(script.ask(emscon::Initialize{}), Status::Ok);
  EXPECT_EQ(script.ask(emscon::FindReflector{2500.0}), Status::Ok);
  EXPECT_EQ(script.ask(emscon::FindReflector{0.0}), Status::WrongParameter1);
  script.device.inject({FaultKind::ReflectorAway, 0.0, 60.0, 0.0, 0}, script.now);
  EXPECT_EQ(script.ask(emscon::FindReflector{2500.0}), Status::NoDistanceSet);
  EXPECT_EQ(script.ask(emscon::GoBirdBath{}), Status::NoDistanceSet);
  EXPECT_EQ(script.ask(emscon::StartMeasurement{}), Status::NoDistanceSet);
  script.run(60s);
  EXPECT_THAT(script.events, Contains(emscon::Event::DistanceSet));
  EXPECT_EQ(script.ask(emscon::GoBirdBath{}), Status::Ok);
  EXPECT_EQ(script.device.beam_moves(), 2u);
}

TEST(TrackerDevice, RefusesAReflectorItDoesNotKnow) {
  const VirtualMachine machine = test::standing_machine();
  TrackerScript script(machine);
  EXPECT_EQ(script.ask(emscon::SetReflector{4}), Status::Ok);
  EXPECT_EQ(script.ask(emscon::SetReflector{7}), Status::WrongParameter1);
  script.ask(emscon::GetReflector{});
  EXPECT_EQ(std::get<emscon::ReflectorAnswer>(script.answers.back()).internal_id, 4);
}

TEST(TrackerDevice, MeasuresOnlyAfterInitialize) {
  const VirtualMachine machine = test::standing_machine();
  TrackerScript script(machine);
  EXPECT_EQ(script.ask(emscon::StartMeasurement{}), Status::TrackerNotInitialized);
}

TEST(TrackerDevice, RefusesInitializeUntilTheLaserIsWarm) {
  const VirtualMachine machine = test::standing_machine();
  TrackerOptions options;
  options.warm_up = 20s;
  TrackerScript script(machine, options);
  script.ask(emscon::GetSystemStatus{});
  EXPECT_EQ(std::get<emscon::SystemStatusAnswer>(script.answers.back()).laser,
            emscon::LaserStatus::Heating);
  EXPECT_EQ(script.ask(emscon::Initialize{}), Status::NotWarmedUp);
  script.run(20s);
  EXPECT_THAT(script.events, Contains(emscon::Event::LaserWarmedUp));
  EXPECT_EQ(script.ask(emscon::Initialize{}), Status::Ok);
}

TEST(TrackerDevice, AcceptsOneCommandAtATime) {
  const VirtualMachine machine = test::standing_machine();
  TrackerScript script(machine);
  script.send(emscon::Initialize{});
  script.send(emscon::GetUnits{});
  ASSERT_EQ(script.answers.size(), 1u);
  EXPECT_EQ(status_of(script.answers[0]), Status::ServerBusy);
  EXPECT_EQ(command_of(script.answers[0]), emscon::Command::GetUnits);
  script.run(3s);
  EXPECT_EQ(command_of(script.answers.back()), emscon::Command::Initialize);
}

TEST(TrackerDevice, ReportsCommandsThatItDoesNotImplement) {
  const VirtualMachine machine = test::standing_machine();
  TrackerScript script(machine);
  constexpr std::array<std::uint8_t, 12> kCommand77{12, 0, 0, 0, 0, 0, 0, 0, 77, 0, 0, 0};
  script.device.receive(std::as_bytes(std::span(kCommand77)), script.now);
  script.run(10ms);
  ASSERT_EQ(script.answers.size(), 1u);
  EXPECT_EQ(status_of(script.answers[0]), Status::NotImplemented);
  EXPECT_EQ(command_of(script.answers[0]), emscon::Command{77});
}

TEST(TrackerDevice, DisconnectsAClientThatDoesNotUseTpi) {
  const VirtualMachine machine = test::standing_machine();
  TrackerScript script(machine);
  script.device.receive(std::as_bytes(std::span("GET / HTTP/1.1\r\n")), script.now);
  EXPECT_TRUE(script.device.wants_close());
}

TEST(TrackerDevice, SendsBurstsAtTheIntervalsOfRealControllers) {
  const VirtualMachine machine = test::standing_machine();
  TrackerScript script(machine);
  script.start_streaming();
  script.run(200s);
  const std::vector<double> gaps = burst_gaps_ms(script.bursts);
  ASSERT_GT(gaps.size(), 500u);
  // 600 draws: standard error of the quantiles below 1 ms, steps of 1 ms.
  EXPECT_NEAR(gaps[gaps.size() / 2], 332.0, 2.0);
  EXPECT_NEAR(gaps[gaps.size() / 20], 324.0, 2.5);
  EXPECT_NEAR(gaps[gaps.size() * 19 / 20], 344.0, 2.5);
}

TEST(TrackerDevice, ABurstContainsAllPointsOfItsInterval) {
  const VirtualMachine machine = test::standing_machine();
  for (const auto& [separation_ms, expected] :
       {std::pair{2, 166.0}, std::pair{20, 16.6}, std::pair{1, 332.0}}) {
    TrackerScript script(machine);
    script.start_streaming(separation_ms);
    script.run(20s);
    const double mean =
        static_cast<double>(script.points().size()) / static_cast<double>(script.bursts.size());
    EXPECT_NEAR(mean, expected, 0.03 * expected);
  }
}

TEST(TrackerDevice, NeverSendsAPointBeforeItsDelay) {
  const VirtualMachine machine = test::standing_machine();
  TrackerOptions options;
  options.delay = 1500us;
  TrackerScript script(machine, options);
  script.start_streaming();
  script.run(30s);
  std::chrono::nanoseconds least = 1s;

  for (const test::Burst& burst : script.bursts) {
    const HostTime last =
        host_time(options.model, HostTime{1000s}, burst.points.back().time.to_device_time());
    least = std::min(least, burst.arrival - last);
  }

  EXPECT_GE(least, 1500us);
  EXPECT_LE(least, 1500us + 1ms);  // the script polls every millisecond
}

TEST(TrackerDevice, ClockRunsFastByItsDrift) {
  const VirtualMachine machine = test::standing_machine();
  TrackerOptions options;
  options.model.clock_drift_ppm = 50.0;
  const DeviceTime early = device_time(options.model, HostTime{1000s}, HostTime{1000s});
  const DeviceTime late = device_time(options.model, HostTime{1000s}, HostTime{2000s});
  EXPECT_EQ(early.time_since_epoch(), 12345s);
  EXPECT_EQ(late - early, 1000s + 50ms);
  EXPECT_EQ(host_time(options.model, HostTime{1000s}, late), HostTime{2000s});
}

TEST(TrackerDevice, PointsLieOnTheGridOfItsOwnClock) {
  const VirtualMachine machine = test::standing_machine();
  TrackerScript script(machine);
  script.start_streaming();
  script.run(2s);
  script.ask(emscon::StopMeasurement{});
  script.run(777ms);
  script.ask(emscon::StartMeasurement{});
  script.run(2s);
  const auto points = script.points();
  for (const auto& p : points) {
    EXPECT_EQ((p.time.to_device_time() - points[0].time.to_device_time()) % 2ms, 0ns);
  }
}

TEST(TrackerDevice, NoiseHasTheStandardDeviationsOfRangeAndAngles) {
  const VirtualMachine machine = test::standing_machine();
  TrackerOptions options;
  TrackerScript script(machine, options);
  script.start_streaming();
  script.run(40s);
  const Eigen::Vector3d truth = R_machine_tracker(options.model).transpose() *
                                (machine.target_m(script.now) - options.model.position_m);
  const Eigen::Vector3d beam = truth.normalized();
  const Eigen::Vector3d side = beam.cross(Eigen::Vector3d::UnitZ()).normalized();
  const Eigen::Vector3d up = side.cross(beam);
  std::vector<double> range, azimuth, elevation;

  for (const auto& p : script.points()) {
    const Eigen::Vector3d e = position_m(p) - truth;
    range.push_back(e.dot(beam));
    azimuth.push_back(e.dot(side));
    elevation.push_back(e.dot(up));
  }

  // 20 000 points: standard error of a standard deviation 0.5 %.
  EXPECT_NEAR(rms(range), 2e-6, 0.05e-6);
  EXPECT_NEAR(rms(azimuth), 3e-6 * truth.norm(), 0.08e-6);
  EXPECT_NEAR(rms(elevation), 3e-6 * truth.norm(), 0.08e-6);
}

TEST(TrackerDevice, SameSeedGivesTheSamePointsForAnyPollInterval) {
  VirtualMachine machine = test::moving_machine(0.1);
  machine.start(HostTime{1003s});
  const auto points = [&](std::uint64_t seed, std::chrono::nanoseconds step) {
    TrackerOptions options;
    options.model.seed = seed;
    options.command_latency = 0ns;
    options.initialize_time = 0ns;
    TrackerScript script(machine, options, step);
    for (const emscon::Request& r : std::vector<emscon::Request>{
             emscon::Initialize{}, emscon::SetMeasurementMode{}, emscon::StartMeasurement{}}) {
      script.send(r);
      script.device.advance(script.now);
    }
    script.run(5s);
    std::vector<std::array<double, 3>> values;
    for (const auto& p : script.points()) values.push_back(p.value);
    return values;
  };

  EXPECT_GT(points(1, 1ms).size(), 2000u);
  EXPECT_EQ(points(1, 1ms), points(1, 250ms));
  EXPECT_NE(points(1, 1ms), points(2, 1ms));
}

TEST(TrackerDevice, BrokenBeamIsAnErrorAndAGapUntilTheBeamReturns) {
  const VirtualMachine machine = test::standing_machine();
  TrackerScript script(machine);
  script.start_streaming();
  script.run(2s);
  script.device.inject({FaultKind::BeamBreak, 0.0, 3.0, 0.0, 0}, script.now);
  script.run(2s);
  EXPECT_EQ(script.errors.size(), 1u);
  EXPECT_THAT(script.events, Contains(emscon::Event::MeasurementNotReady));
  EXPECT_THAT(script.events, Not(Contains(emscon::Event::MeasurementReady)));
  script.run(3s);
  EXPECT_THAT(script.events, Contains(emscon::Event::MeasurementReady));
  std::chrono::nanoseconds widest{};
  const auto points = script.points();

  for (std::size_t i = 1; i < points.size(); ++i) {
    widest =
        std::max(widest, points[i].time.to_device_time() - points[i - 1].time.to_device_time());
  }

  EXPECT_NEAR(ns_to_seconds(widest), 3.0, 0.005);
}

TEST(TrackerDevice, DoesNotStartWithoutABeam) {
  const VirtualMachine machine = test::standing_machine();
  TrackerScript script(machine);
  script.ask(emscon::Initialize{});
  script.ask(emscon::SetMeasurementMode{});
  script.device.inject({FaultKind::BeamBreak, 0.0, 3.0, 0.0, 0}, script.now);
  EXPECT_EQ(script.ask(emscon::StartMeasurement{}), Status::MeasurementNotReady);
  script.run(3s);
  EXPECT_EQ(script.ask(emscon::StartMeasurement{}), Status::Ok);
}

TEST(TrackerDevice, FlagsPointsOfATargetThatIsTooFast) {
  VirtualMachine machine = test::moving_machine(0.5);
  machine.start(HostTime{1000s});
  TrackerOptions options;
  options.initialize_time = 10ms;
  options.model.max_lateral_speed_m_per_s = 0.2;
  TrackerScript script(machine, options);
  script.start_streaming();
  script.run(10s);
  const auto points = script.points();

  EXPECT_THAT(points,
              Contains(Field(&emscon::MultiPoint::status, emscon::PointStatus::SpeedExceeded)));
  EXPECT_THAT(points,
              Contains(Field(&emscon::MultiPoint::status, emscon::PointStatus::SpeedWarning)));
  EXPECT_EQ(points.back().status, emscon::PointStatus::Ok);  // the target has stopped
}

TEST(TrackerDevice, MarksPointsWithTheInjectedFault) {
  const VirtualMachine machine = test::standing_machine();
  TrackerScript script(machine);
  script.start_streaming();
  script.run(1s);
  script.device.inject({FaultKind::PrismError, 0.0, 0.1, 0.0, 0}, script.now);
  script.run(1s);
  const auto points = script.points();
  const auto bad = std::count_if(points.begin(), points.end(), [](const emscon::MultiPoint& p) {
    return p.status == emscon::PointStatus::PrismError;
  });
  EXPECT_NEAR(static_cast<double>(bad), 50.0, 1.0);
}

TEST(TrackerDevice, StalledSocketLosesNothing) {
  const VirtualMachine machine = test::standing_machine();
  TrackerScript script(machine);
  script.start_streaming();
  script.run(1s);
  script.device.inject({FaultKind::Stall, 0.0, 2.0, 0.0, 0}, script.now);
  const std::size_t before = script.bursts.size();
  script.run(1900ms);
  EXPECT_EQ(script.bursts.size(), before);
  script.run(1s);
  const auto points = script.points();

  for (std::size_t i = 1; i < points.size(); ++i) {
    ASSERT_EQ(points[i].time.to_device_time() - points[i - 1].time.to_device_time(), 2ms);
  }
}

TEST(TrackerDevice, BusyControllerAnswersServerBusy) {
  const VirtualMachine machine = test::standing_machine();
  TrackerScript script(machine);
  script.device.inject({FaultKind::Busy, 0.0, 1.0, 0.0, 0}, script.now);
  EXPECT_EQ(script.ask(emscon::GetUnits{}), Status::ServerBusy);
  script.run(1s);
  EXPECT_EQ(script.ask(emscon::GetUnits{}), Status::Ok);
}

TEST(TrackerDevice, ReportsAWeatherChange) {
  const VirtualMachine machine = test::standing_machine();
  TrackerScript script(machine);
  script.start_streaming();
  script.device.inject({FaultKind::Weather, 0.0, 0.0, 1.5, 0}, script.now);
  script.run(1s);
  EXPECT_THAT(script.events, Contains(emscon::Event::EnvironmentParamsChanged));
  script.ask(emscon::GetEnvironmentParams{});
  EXPECT_NEAR(std::get<emscon::EnvironmentAnswer>(script.answers.back()).environment.temperature,
              21.5, 0.01);
}

TEST(TrackerDevice, RebootResetsAllStateAndTheClock) {
  const VirtualMachine machine = test::standing_machine();
  TrackerScript script(machine);
  script.start_streaming();
  script.run(1s);
  script.device.inject({FaultKind::Reboot, 0.0, 5.0, 0.0, 0}, script.now);

  EXPECT_TRUE(script.device.wants_close());
  EXPECT_FALSE(script.device.accepts());
  script.run(5s);
  EXPECT_THAT(script.events, Contains(emscon::Event::ServerClosing));
  EXPECT_TRUE(script.device.accepts());
  script.device.disconnected();
  script.device.connected(script.now);
  EXPECT_EQ(script.ask(emscon::StartMeasurement{}), Status::TrackerNotInitialized);
  EXPECT_THAT(script.events, Contains(emscon::Event::ServerStarted));
  const std::size_t before = script.points().size();
  script.start_streaming();
  script.run(1s);
  const auto points = script.points();
  EXPECT_LT(points.back().time.to_device_time(), points[before - 1].time.to_device_time() + 4s);
}

TEST(TrackerDevice, MeasuresAStandingTargetOnce) {
  const VirtualMachine machine = test::standing_machine();
  TrackerScript script(machine);
  script.ask(emscon::Initialize{});
  script.ask(emscon::SetMeasurementMode{emscon::MeasurementMode::Stationary});
  script.ask(emscon::SetStationaryModeParams{500, false});
  script.ask(emscon::StartMeasurement{});
  script.run(1s);

  ASSERT_EQ(script.singles.size(), 1u);
  const TrackerModel model;
  const Eigen::Vector3d truth =
      R_machine_tracker(model).transpose() * (machine.target_m(script.now) - model.position_m);
  const auto& v = script.singles[0].value;
  EXPECT_LT((1e-3 * Eigen::Vector3d(v[0], v[1], v[2]) - truth).norm(),
            1e-6);  // 500 points: sigma 0.2 um
}

TEST(TrackerDevice, StopsAfterTheRequestedNumberOfPoints) {
  const VirtualMachine machine = test::standing_machine();
  TrackerScript script(machine);
  script.ask(emscon::Initialize{});
  script.ask(emscon::SetMeasurementMode{});
  script.ask(emscon::SetContinuousTimeModeParams{2, 300, false, {}});
  script.ask(emscon::StartMeasurement{});
  script.run(2s);
  EXPECT_EQ(script.points().size(), 300u);
  EXPECT_THAT(script.events, Contains(emscon::Event::MeasurementCountReached));
}

TEST(TrackerDevice, UsesTheUnitsThatWereSet) {
  const VirtualMachine machine = test::standing_machine();
  TrackerScript script(machine);
  emscon::SetUnits units;
  units.units.length = emscon::LengthUnit::Metre;
  script.ask(units);
  script.start_streaming();
  script.run(1s);
  const auto p = script.points().front();
  EXPECT_NEAR(std::hypot(p.value[0], p.value[1], p.value[2]), 1.2, 0.2);
}

}  // namespace
}  // namespace abbe::sim
