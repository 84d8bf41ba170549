#pragma once
/// One scan of a counter card: the values of all counters at one instant, the start of the scan.
/// Units: axes in m or rad, the rest in counts. A CounterScanSink receives every scan; touch
/// detection and reference marks need it.

#include <cstdint>
#include <type_traits>

#include "abbe/protocol/rt.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::drivers {

/// All counts are unwrapped to 64 bit and are 0 at the set-up of the counters. After a restart of
/// the card (SampleFlag::Restarted) every count restarts at 0. Counts continue across lost scans
/// (SampleFlag::GapBefore).
struct CounterScan {
  /// `axes.head`: time, flags and uncertainty of the scan. `axes.cycle`: number of the scan,
  /// including lost scans. An axis in `index_latched_mask` has no live reading: it is also in
  /// axes.missing_mask.
  protocol::AxisSample axes;
  std::int64_t clock_count = 0;  ///< the time base; periods of the counted clock
  /// clock_count at the latest probe edge. ASSUMPTION, to be verified on hardware: in a scan, a
  /// counter with latch-on-index delivers its count at the latest index edge.
  std::int64_t latch_count = 0;
  /// Half-width h of the interval [latch_count - h, latch_count + h] that contains the true latch;
  /// 0 if latch and clock channel have the same zero.
  std::int64_t latch_half_width = 0;
  /// Number of probe edges. If there are several edges since the previous scan, latch_count is that
  /// of the last one.
  std::int64_t edge_count = 0;
  /// false: no probe edge since the set-up of the counters, latch_count is invalid
  bool latched = false;
  /// bit i: axes.count[i] is not the live count of axis i, but its count at the latest index pulse
  std::uint8_t index_latched_mask = 0;
};
static_assert(std::is_trivially_copyable_v<CounterScan>);

/// Receives every scan, in order. The device thread or a replay calls it, in real time.
class CounterScanSink {
 public:
  CounterScanSink() = default;
  CounterScanSink(const CounterScanSink&) = delete;
  CounterScanSink& operator=(const CounterScanSink&) = delete;
  virtual ~CounterScanSink() = default;
  virtual void on_scan(const CounterScan& scan) ABBE_RT = 0;
};

}  // namespace abbe::drivers
