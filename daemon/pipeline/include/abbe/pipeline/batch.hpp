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
struct RawFromEnvironment {
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
  std::vector<protocol::RawBlock> tracker_raw;
  std::vector<protocol::RawBlock> encoder_raw;
  std::vector<protocol::RawBlock> probe_raw;      ///< of a measuring machine
  std::vector<protocol::RawBlock> reference_raw;  ///< of the second counter card
  std::vector<RawFromEnvironment> environment_raw;

  void clear() noexcept {
    points.clear();
    axes.clear();
    environment.clear();
    measured_environment.clear();
    touches.clear();
    touch_scans.clear();
    marks.clear();
    tracker_raw.clear();
    encoder_raw.clear();
    probe_raw.clear();
    reference_raw.clear();
    environment_raw.clear();
  }
  [[nodiscard]] bool empty() const noexcept {
    return points.empty() && axes.empty() && environment.empty() && measured_environment.empty() &&
           touches.empty() && touch_scans.empty() && marks.empty() && tracker_raw.empty() &&
           encoder_raw.empty() && probe_raw.empty() && reference_raw.empty() &&
           environment_raw.empty();
  }
};

}  // namespace abbe::daemon
