#pragma once
/// One scan of a counter card: all counters as they stood at one instant, the start of the scan.
/// Units: axes in m or rad, the rest in counts. Whoever needs more than the axes (trigger
/// detection, reference marks) sees every scan through a CounterScanSink.

#include <cstdint>
#include <type_traits>

#include "abbe/protocol/rt.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::drivers {

/// All counts are unwrapped to 64 bit. Zero is where the card's set-up put them: after a restart of
/// the card (SampleFlag::Restarted) every count begins anew. Counts go on over lost scans
/// (SampleFlag::GapBefore).
struct CounterScan {
  /// Time, flags and uncertainty of the scan in `axes.head`; `axes.cycle` is the number of the
  /// scan, lost ones included. An axis in `index_latched_mask` has no live reading: it is also in
  /// axes.missing_mask.
  protocol::AxisSample axes;
  std::int64_t clock_count = 0;  ///< the time base; periods of the counted clock
  /// clock_count at the latest probe edge. ASSUMPTION, to be verified on hardware: a counter set up
  /// with latch-on-index gives, in a scan, its count at the latest index edge.
  std::int64_t latch_count = 0;
  /// The true latch lies in [latch_count - h, latch_count + h]; 0 if latch and clock channel count
  /// in step.
  std::int64_t latch_half_width = 0;
  /// probe edges; two or more more than before: the latch is that of the last
  std::int64_t edge_count = 0;
  /// false: no probe edge since the counters were set up, latch_count says nothing
  bool latched = false;
  /// bit i: axes.count[i] is that of axis i at its latest index pulse
  std::uint8_t index_latched_mask = 0;
};
static_assert(std::is_trivially_copyable_v<CounterScan>);

/// Called by the device thread (or by a replay), in real time, once a scan, in order.
class CounterScanSink {
 public:
  CounterScanSink() = default;
  CounterScanSink(const CounterScanSink&) = delete;
  CounterScanSink& operator=(const CounterScanSink&) = delete;
  virtual ~CounterScanSink() = default;
  virtual void on_scan(const CounterScan& scan) ABBE_RT = 0;
};

}  // namespace abbe::drivers
