#pragma once
/// A machine for tests of a calibration session, without devices and hub.

#include <chrono>
#include <cmath>
#include <optional>

#include "abbe/methods/calibration_session.hpp"

namespace abbe::daemon::test {

/// Drives a machine point by point and shows every snapshot to a session.
class SessionDrive {
 public:
  static constexpr std::chrono::nanoseconds kPeriod = std::chrono::milliseconds{2};  // 500 per s

  explicit SessionDrive(CalibrationSession& session) : session_(session) {}

  void stand(AxisPosition q, std::chrono::nanoseconds how_long) {
    q_ = q;
    speed_m_per_s_ = 0.0;
    for (std::chrono::nanoseconds t{}; t < how_long; t += kPeriod) show();
  }
  void move(AxisPosition to) {
    const AxisPosition from = q_;
    const double way = std::hypot(to[0] - from[0], to[1] - from[1], to[2] - from[2]);
    const int steps = static_cast<int>(std::ceil(way / kStep_m));
    speed_m_per_s_ = kStep_m / std::chrono::duration<double>(kPeriod).count();
    for (int i = 1; i <= steps; ++i) {
      for (std::size_t a = 0; a < 3; ++a) q_[a] = from[a] + (to[a] - from[a]) * i / steps;
      show();
    }
  }
  void pause(std::chrono::nanoseconds how_long) { now_ += how_long; }
  void jump(AxisPosition to) { q_ = to; }  ///< without a snapshot on the way
  /// Offset of the tracker's clock from host time; 500 s at first.
  void set_device_clock(std::chrono::nanoseconds ahead) { device_ahead_ = ahead; }
  void lose_axes() { axes_known_ = false; }
  void unsettle_clock(bool unsettled) { unsettled_ = unsettled; }  ///< of the tracker
  void set_environment(const protocol::EnvironmentSample& e) { environment_ = e; }
  [[nodiscard]] protocol::HostTime now() const { return now_; }

 private:
  static constexpr double kStep_m = 100e-6;  // 50 mm/s

  void show() {
    protocol::Snapshot s;
    s.head.time = now_;
    s.axis_count = axes_known_ ? 3 : 0;
    for (std::size_t a = 0; a < 3; ++a) s.position[a] = q_[a];
    s.velocity[0] = speed_m_per_s_;
    s.has_tracker_point = true;
    s.tracker_point.device_time = protocol::DeviceTime{now_.time_since_epoch() + device_ahead_};
    s.tracker_point.p_tracker_m = q_;
    if (unsettled_)
      s.tracker_point.head.flags |=
          static_cast<protocol::SampleFlags>(protocol::SampleFlag::ClockUnsettled);
    s.has_environment = environment_.has_value();
    if (environment_) s.environment = *environment_;
    session_.take(s);
    now_ += kPeriod;
  }

  CalibrationSession& session_;
  AxisPosition q_{};
  double speed_m_per_s_ = 0.0;
  protocol::HostTime now_{std::chrono::seconds{10}};
  std::chrono::nanoseconds device_ahead_ = std::chrono::seconds{500};
  bool axes_known_ = true, unsettled_ = false;
  std::optional<protocol::EnvironmentSample> environment_;
};

}  // namespace abbe::daemon::test
