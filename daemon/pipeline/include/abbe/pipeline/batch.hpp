#pragma once
/// What the hub took out of the rings in one turn, or a replay out of a recording: every stream in
/// its own order. Reused from turn to turn, so that it stops allocating once it has grown. Pure
/// data.

#include <cstddef>
#include <vector>

#include "abbe/drivers/sampling/mark_watcher.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::daemon {

/// From the device of that place in Config::environment.
struct FromEnvironment {
  std::size_t device = 0;
  protocol::EnvironmentSample sample;
};
/// From the device of that place in DeviceNames::all.
struct RawFromDevice {
  std::size_t device = 0;
  protocol::RawBlock block;
};

struct Batch {
  /// When: a recording keeps it, and a replay gives the same turns again. clear() leaves it.
  protocol::HostTime taken{};
  std::vector<protocol::TrackerPoint> points;
  std::vector<protocol::AxisSample> axes;
  std::vector<protocol::EnvironmentSample> environment;  ///< the weather of the tracker
  std::vector<FromEnvironment> measured_environment;
  std::vector<protocol::ProbeTrigger> touches;
  std::vector<protocol::TouchScan> touch_scans;
  std::vector<drivers::MarkCrossing>
      marks;  ///< of the second card: its bytes are recorded, not these
  std::vector<RawFromDevice> raw;

  void clear() noexcept {
    points.clear();
    axes.clear();
    environment.clear();
    measured_environment.clear();
    touches.clear();
    touch_scans.clear();
    marks.clear();
    raw.clear();
  }
  [[nodiscard]] bool empty() const noexcept {
    return points.empty() && axes.empty() && environment.empty() && measured_environment.empty() &&
           touches.empty() && touch_scans.empty() && marks.empty() && raw.empty();
  }
};

}  // namespace abbe::daemon
