#pragma once
/// The samples that the hub took from the rings in one cycle, or that a replay took from a
/// recording. The samples of each stream are in their order. The same object is reused in each
/// cycle and keeps its capacity, so that it allocates only in the first cycles. Pure data.

#include <cstddef>
#include <vector>

#include "abbe/drivers/sampling/mark_watcher.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::daemon {

struct FromEnvironment {
  std::size_t device = 0;  ///< index in DeviceNames::environment
  protocol::EnvironmentSample sample;
};
struct RawFromDevice {
  std::size_t device = 0;  ///< index in DeviceNames::all
  protocol::RawBlock block;
};

/// Key in the version entries of a recording. In a recording with this key, no two axis samples
/// have the same instant. In one without it (older versions of abbe), a second sample with the same
/// instant may follow, which only marks further axes of the first sample as missing.
inline constexpr const char* kAxisSamplesRule = "axis_samples";

/// Key in the version entries of a recording. In a recording with this key, the first reading of a
/// rotary axis of [encoder] was chosen nearest to the middle of its travel. In one without it
/// (older versions of abbe), the first count was used as sent.
inline constexpr const char* kRotaryTravelRule = "rotary_travel";

struct Batch {
  /// Time of the cycle. The recorder stores it, so that a replay repeats the same cycles. clear()
  /// does not reset it.
  protocol::HostTime taken{};
  std::vector<protocol::TrackerPoint> points;
  std::vector<protocol::AxisSample> axes;
  /// samples from the tracker's weather station
  std::vector<protocol::EnvironmentSample> environment;
  std::vector<FromEnvironment> measured_environment;
  std::vector<protocol::ProbeTrigger> touches;
  std::vector<protocol::TouchScan> touch_scans;
  /// Crossings of reference marks, from the reference card. They are not recorded; the raw bytes of
  /// the card are.
  std::vector<drivers::MarkCrossing> marks;
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
