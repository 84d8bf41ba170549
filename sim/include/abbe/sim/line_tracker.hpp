#pragma once
/// A tracker whose measuring program prints its points as lines of text, in bursts. Not
/// thread-safe.
///
/// The grid of points and their noise are those of TrackerDevice: the n-th point of a run has the
/// same noise.

#include <chrono>
#include <string>

#include "abbe/protocol/lines/tracker_line.hpp"
#include "abbe/sim/fault.hpp"
#include "abbe/sim/line_source.hpp"
#include "abbe/sim/tracker_model.hpp"

namespace abbe::sim {

struct LineTrackerOptions {
  TrackerModel model;
  /// from a point to the earliest burst that contains it
  std::chrono::nanoseconds delay = std::chrono::milliseconds{1};
  std::chrono::nanoseconds separation = std::chrono::milliseconds{2};
  /// What is printed. Status: the first valid status of the format, or "1".
  lines::LineFormat format;
};

/// One line, with LF. `p_tracker_m`: position; `t`: of the tracker's clock.
[[nodiscard]] std::string print_line(const lines::LineFormat& format,
                                     const Eigen::Vector3d& p_tracker_m, DeviceTime t, bool valid);

class LineTracker final : public LineSource {
 public:
  /// The tracker is switched on at `now`. `machine` must outlive it. Further faults: BeamBreak and
  /// ReflectorAway (no points), SpeedExceeded (invalid status).
  LineTracker(const LineTrackerOptions& options, const VirtualMachine& machine, HostTime now);

 private:
  [[nodiscard]] std::string print(const Instant& instant) const override;
  void inject_own(const Fault& fault, HostTime now, HostTime until) override;

  LineTrackerOptions options_;
  const VirtualMachine& machine_;
  MeasuringTime beam_broken_, too_fast_;
};

}  // namespace abbe::sim
