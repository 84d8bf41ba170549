#pragma once
/// Which tracker points belong to one on-the-fly run: from the standstill at the first vertex of the path to
/// the standstill at the last. Decided from snapshots alone, never from a clock, so that a replay takes the
/// very same points. Ordinary world; not thread-safe; lengths m, axis positions as scale readings in the
/// order X, Y, Z.

#include <array>
#include <chrono>
#include <cstdint>
#include <deque>
#include <string>
#include <utility>
#include <vector>

#include "abbe/protocol/samples.hpp"

namespace abbe::daemon {

using AxisPosition = std::array<double, 3>;

/// One point of the run as identification sees it.
struct RunPoint {
  protocol::HostTime time{};
  protocol::DeviceTime device_time{};
  std::array<double, 3> p_tracker_m{};
  bool usable =
      true;  ///< false: too fast, prism error or trigger violation; it holds its place in the sequence
};

struct AcquisitionOptions {
  double stand_tolerance_m = 0.2e-3;  ///< a machine that moves less than this is standing
  double vertex_tolerance_m = 2e-3;   ///< how near to the first and last vertex the machine must stand
  double path_tolerance_m = 10e-3;    ///< farther from every leg than this means another path is being driven
  std::chrono::nanoseconds stand_before =
      std::chrono::milliseconds{200};  ///< 20 points at 100 Hz, see [calib] alignment
  std::chrono::nanoseconds keep_before =
      std::chrono::milliseconds{400};  ///< standstill kept in front of the run
  std::chrono::nanoseconds stand_after =
      std::chrono::milliseconds{1000};  ///< longer than any dwell at a vertex
  std::chrono::nanoseconds keep_after = std::chrono::milliseconds{400};  ///< standstill kept behind the run
  std::chrono::nanoseconds silence = std::chrono::seconds{30};  ///< a beam gone for longer ends the run
};

class OtfAcquisition {
 public:
  enum class Phase : std::uint8_t { WaitingAtStart, Running, Complete, Failed };

  /// `path`: vertices of the polyline, at least two. `from`: snapshots before this instant are not looked at.
  OtfAcquisition(std::vector<AxisPosition> path, protocol::HostTime from, AcquisitionOptions options = {});

  void take(const protocol::Snapshot& snapshot);

  [[nodiscard]] Phase phase() const noexcept { return phase_; }
  [[nodiscard]] const std::string& reason() const noexcept {
    return reason_;
  }                                                ///< why Failed, or what is waited for
  [[nodiscard]] double progress() const noexcept;  ///< 0 to 1 of the path length driven
  [[nodiscard]] const std::vector<RunPoint>& points() const noexcept { return points_; }
  [[nodiscard]] std::vector<RunPoint> release() noexcept { return std::move(points_); }

 private:
  void wait_at_start(const RunPoint& point, const AxisPosition& q);
  void run(const RunPoint& point, const AxisPosition& q);
  void track_standstill(const RunPoint& point, const AxisPosition& q);
  void follow_path(const RunPoint& point, const AxisPosition& q);
  [[nodiscard]] bool complete(protocol::HostTime now, const AxisPosition& q) const;
  void trim_end();
  void fail(std::string reason);

  std::vector<AxisPosition> path_;
  protocol::HostTime from_;
  AcquisitionOptions options_;
  double path_length_m_ = 0.0;
  Phase phase_ = Phase::WaitingAtStart;
  std::string reason_;
  std::deque<RunPoint> before_;  // standstill at the first vertex, the last keep_before of it
  std::vector<RunPoint> points_;
  AxisPosition stand_at_{};  // where the current standstill began
  protocol::HostTime stand_since_{};
  bool stand_known_ = false;
  std::size_t leg_ = 0;             // the machine is on, or just before, this leg
  protocol::HostTime on_leg_at_{};  // when it was last seen there
  double driven_m_ = 0.0;           // along the path, up to the machine
  protocol::HostTime last_time_{};
};

}  // namespace abbe::daemon
