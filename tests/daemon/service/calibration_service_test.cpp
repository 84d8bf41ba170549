#include "abbe/service/calibration_service.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <optional>
#include <thread>

#include "abbe/config/config.hpp"
#include "abbe/service/background_tasks.hpp"
#include "synthetic_otf_run.hpp"
#include "temporary_folder.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using protocol::HostTime;

class CalibrationServiceTest : public ::testing::Test {
 protected:
  CalibrationServiceTest()
      : config_(parse_config(test::synthetic_machine_toml(), "machine.toml").value()) {
    authority_.emplace(ModelAuthority::open(folder_.path() / "models", config_, {}, HostTime{1s}));
    service_.emplace(config_, *authority_, nullptr);
  }
  /// The machine drives the path at 100 mm/s; a point every 5 ms.
  void drive() {
    const auto path = test::synthetic_request_path_m();
    stand(path.front(), 1s);
    for (std::size_t leg = 1; leg < path.size(); ++leg) {
      const auto &from = path[leg - 1], &to = path[leg];
      const double way = std::hypot(to[0] - from[0], to[1] - from[1], to[2] - from[2]);
      const int steps = static_cast<int>(std::ceil(way / 0.5e-3));
      for (int i = 1; i <= steps; ++i) {
        AxisPosition q{};
        for (std::size_t a = 0; a < 3; ++a) q[a] = from[a] + (to[a] - from[a]) * i / steps;
        show(q);
      }
    }

    stand(path.back(), 2s);
  }
  [[nodiscard]] SessionState state() const { return service_->status().state; }
  void cycle() { (void)service_->cycle({}, now_); }

  TemporaryFolder folder_;
  Config config_;
  std::optional<ModelAuthority> authority_;
  std::optional<CalibrationService> service_;
  HostTime now_{10s};

 private:
  void stand(const AxisPosition& q, std::chrono::nanoseconds how_long) {
    for (auto t = 0ns; t < how_long; t += 5ms) show(q);
  }
  void show(const AxisPosition& q) {
    protocol::Snapshot s;
    s.head.time = now_;
    s.axis_count = 3;
    for (std::size_t a = 0; a < 3; ++a) s.position[a] = q[a];
    s.has_tracker_point = true;
    s.tracker_point.device_time = protocol::DeviceTime{now_.time_since_epoch()};
    s.tracker_point.p_tracker_m = q;
    (void)service_->cycle({&s, 1}, now_);
    now_ += 5ms;
  }
};

TEST_F(CalibrationServiceTest, KeepsTheVerdictsOfEndedSessionsByTheirNumber) {
  for (std::uint64_t id = 1; id <= 7; ++id) {
    const auto started =
        service_->start(OtfRequest{test::synthetic_request_path_m()}, "anna", now_);
    ASSERT_TRUE(started) << started.error().text;
    EXPECT_EQ(*started, id);
    ASSERT_TRUE(service_->cancel("anna", now_));
  }
  ASSERT_EQ(service_->session().ended().size(), CalibrationSession::kEndedKept);
  EXPECT_EQ(service_->session().ended().front().id, 3u);
  EXPECT_EQ(service_->session().ended().back().reason, "cancelled by anna");
}

TEST_F(CalibrationServiceTest, AnIdentificationIsCancelledAndTheNextCanStart) {
  ASSERT_TRUE(service_->start(OtfRequest{test::synthetic_request_path_m()}, "anna", now_));
  drive();
  ASSERT_EQ(state(), SessionState::Identifying) << service_->status().reason;
  ASSERT_TRUE(service_->cancel("anna", now_));
  EXPECT_EQ(state(), SessionState::Refused);
  auto again = service_->start(OtfRequest{test::synthetic_request_path_m()}, "anna", now_);
  for (; !again;
       again = service_->start(OtfRequest{test::synthetic_request_path_m()}, "anna", now_)) {
    EXPECT_NE(again.error().text.find("is still ending"), std::string::npos) << again.error().text;
    std::this_thread::yield();
    cycle();
  }
  EXPECT_EQ(*again, 2u);
}

TEST_F(CalibrationServiceTest, EndsWhileAnIdentificationRuns) {
  ASSERT_TRUE(service_->start(OtfRequest{test::synthetic_request_path_m()}, "anna", now_));
  drive();
  ASSERT_EQ(state(), SessionState::Identifying);
  service_.reset();
  while (background_tasks_running()) std::this_thread::yield();
}

}  // namespace
}  // namespace abbe::daemon
