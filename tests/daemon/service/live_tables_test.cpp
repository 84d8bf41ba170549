// Tables of an on-the-fly run while the machine moves: against the identified model, in pieces, and
// as the service shows them.
#include "abbe/methods/otf/live_tables.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <thread>

#include "abbe/base/units.hpp"
#include "abbe/methods/otf/identification.hpp"
#include "abbe/methods/otf/method.hpp"
#include "abbe/service/background_tasks.hpp"
#include "abbe/service/calibration_service.hpp"
#include "synthetic_otf_run.hpp"
#include "temporary_folder.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using protocol::HostTime;

Config live_config() {
  return parse_config(test::synthetic_machine_toml(), "machine.toml").value();
}

/// A standstill at the first vertex, the run, a standstill at the last.
std::vector<protocol::Snapshot> live_snapshots() {
  std::vector<protocol::Snapshot> snapshots;
  for (const auto& point : test::synthetic_points(0.6, 2.0)) {
    protocol::Snapshot& s = snapshots.emplace_back();
    const auto time = std::chrono::duration_cast<std::chrono::nanoseconds>(
        std::chrono::duration<double>(point.time_s));
    s.head.time = HostTime{10s + time};
    s.axis_count = 3;
    s.has_tracker_point = true;
    s.tracker_point.device_time = protocol::DeviceTime{time};
    for (std::size_t a = 0; a < 3; ++a) {
      s.position[a] = point.q_m[static_cast<Eigen::Index>(a)];
      s.tracker_point.p_tracker_m[a] = point.p_tracker_m[static_cast<Eigen::Index>(a)];
    }
  }
  return snapshots;
}

/// The run, with the live tables fed every `every` snapshots.
class LiveRun {
 public:
  explicit LiveRun(std::size_t every) : every_(every) {}

  /// Up to this share of the path; nullopt: to the end.
  void drive(std::optional<double> share = std::nullopt) {
    std::size_t number = 0;
    for (const auto& snapshot : live_snapshots()) {
      acquisition.take(snapshot);
      if (++number % every_ == 0) take();
      if (share && acquisition.progress() >= *share) break;
    }
    take();
  }

  OtfAcquisition acquisition{test::synthetic_request_path_m()};
  OtfLiveTables live = OtfLiveTables::of(live_config()).value();

 private:
  void take() {
    live.take(acquisition.take_news());
    (void)live.tables();
  }
  std::size_t every_;
};

double largest_difference_in_u(const LiveTables& live, const calib::VolumetricModel& model) {
  double largest = 0.0;
  const auto parameters = model.parameters();
  std::size_t i = 0;
  for (const LiveTable& table : live.tables) {
    for (std::size_t node = 0; node < table.value.size(); ++node, ++i) {
      constexpr double kFixedByDatum = 1e-8;  // its u is 1e-9
      const double u = std::max(table.u[node], kFixedByDatum);
      EXPECT_EQ(parameters[i].name, table.name);
      largest = std::max(largest, std::abs(table.value[node] - parameters[i].value) / u);
    }
  }
  return largest;
}

/// They differ by the samples near the corners, means of segments, and the scatter of the alignment.
TEST(LiveTables, OfACompleteRunAgreeWithItsModel) {
  LiveRun run(500);
  run.drive();
  ASSERT_EQ(run.acquisition.phase(), AcquisitionPhase::Complete) << run.acquisition.reason();
  const auto live = run.live.tables();
  ASSERT_TRUE(live) << live.error().text;

  const Config config = live_config();
  const auto identified =
      OtfMethod::identify(OtfMethod::run_of(std::move(run.acquisition)), config, nullptr, {});
  ASSERT_TRUE(identified) << identified.error().text;
  EXPECT_LT(largest_difference_in_u(*live, identified->solution.model), 2.0);
}

TEST(LiveTables, DoNotDependOnTheTimesAtWhichTheyAreSolved) {
  LiveRun often(300), once(1'000'000);
  often.drive();
  once.drive();
  const auto a = often.live.tables(), b = once.live.tables();
  ASSERT_TRUE(a && b);
  // The pose moves the limit at a corner by um: at most one sample at each end of the 60 legs.
  EXPECT_NEAR(static_cast<double>(a->samples), static_cast<double>(b->samples), 120.0);
  for (std::size_t t = 0; t < a->tables.size(); ++t)
    for (std::size_t i = 0; i < a->tables[t].value.size(); ++i)
      // Two poses whose terms of second order differ by 0.1 um at most.
      EXPECT_NEAR(a->tables[t].value[i], b->tables[t].value[i], 1e-6) << a->tables[t].name;
}

TEST(LiveTables, OfOneLegShowNothing) {
  LiveRun run(200);
  run.drive(0.01);
  const auto live = run.live.tables();
  ASSERT_FALSE(live);
  EXPECT_EQ(live.error().code, ErrorCode::DataInsufficient);
}

TEST(LiveTables, OfFewLegsHaveNoNumberForATableThatIsNotDetermined) {
  LiveRun run(200);
  run.drive(0.12);
  const auto live = run.live.tables();
  ASSERT_TRUE(live) << live.error().text;
  const auto determined = std::ranges::count_if(live->tables, &LiveTable::determined);
  EXPECT_LT(determined, std::ssize(live->tables));
  for (const LiveTable& table : live->tables)
    for (std::size_t i = 0; i < table.value.size(); ++i)
      EXPECT_EQ(std::isnan(table.value[i]), std::isnan(table.u[i])) << table.name;
}

TEST(OtfAcquisition, EstimatesTheRemainingTime) {
  const auto snapshots = live_snapshots();
  OtfAcquisition acquisition{test::synthetic_request_path_m()};
  for (const auto& snapshot : snapshots) {
    acquisition.take(snapshot);
    if (acquisition.progress() < 0.5) continue;
    const auto left = acquisition.remaining();
    ASSERT_TRUE(left);
    const auto true_left = snapshots.back().head.time - snapshot.head.time;
    EXPECT_NEAR(in_seconds(*left), in_seconds(true_left), 0.25 * in_seconds(true_left));
    return;
  }
  FAIL() << "the run ended at " << acquisition.progress() << ": " << acquisition.reason();
}

/// A leg of 1 mm ends before the machine is seen on it, but it reverses X.
TEST(OtfAcquisition, BeginsLegsBetweenTwoTrackerPoints) {
  const std::vector<AxisPosition> path{{0, 0, 0}, {0.05, 0, 0}, {0.049, 0, 0}, {0.049, 0.05, 0}};
  OtfAcquisition acquisition{path};
  HostTime now{10s};
  const auto take = [&](const AxisPosition& q_m) {
    protocol::Snapshot s;
    s.head.time = now += 10ms;
    s.axis_count = 3;
    s.has_tracker_point = true;
    s.tracker_point.device_time = protocol::DeviceTime{now.time_since_epoch()};
    std::ranges::copy(q_m, s.position.begin());
    std::ranges::copy(q_m, s.tracker_point.p_tracker_m.begin());
    acquisition.take(s);
  };
  for (int i = 0; i < 50; ++i) take(path[0]);
  for (int mm = 1; mm < 50; ++mm) take({1e-3 * mm, 0, 0});
  for (int mm = 0; mm < 40; ++mm) take({0.049, 1e-3 * mm, 0});

  const auto legs = acquisition.take_news().legs;
  ASSERT_EQ(legs.size(), 3u) << acquisition.reason();
  EXPECT_EQ(legs[1].to_m, path[2]);
  EXPECT_EQ(legs[2].to_m, path[3]);
  EXPECT_EQ(legs[1].first_point, legs[2].first_point);
}

TEST(LiveTables, AreInTheStatusOfTheSessionWhileTheMachineMoves) {
  const TemporaryFolder folder;
  const Config config = live_config();
  ModelAuthority authority =
      ModelAuthority::open(folder.path() / "models", config, {}, HostTime{1s});
  CalibrationService service{config, authority, nullptr};
  ASSERT_TRUE(service.start(OtfRequest{test::synthetic_request_path_m()}, "anna", HostTime{10s}));
  HostTime now{};
  for (const auto& snapshot : live_snapshots()) {
    now = snapshot.head.time;
    (void)service.cycle({&snapshot, 1}, now);
    if (service.status().progress > 0.9) break;
  }
  ASSERT_EQ(service.status().state, SessionState::Acquiring) << service.status().reason;

  while (!service.status().live) {
    std::this_thread::yield();
    (void)service.cycle({}, now);
  }
  EXPECT_EQ(service.status().live->tables.size(), 17u);

  ASSERT_TRUE(service.cancel("anna", now));
  EXPECT_EQ(service.status().live, nullptr);
}

}  // namespace
}  // namespace abbe::daemon
