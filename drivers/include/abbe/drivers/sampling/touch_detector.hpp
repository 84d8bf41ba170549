#pragma once
/// Detects touches in the scans of a counter card: first edge, confirmation, position at the
/// contact, re-arming on retraction. It also outputs the scans around every touch (the window). It
/// is a CounterScanSink; the same scans give the same touches, live and in a replay. A touch is
/// output when it is confirmed; the scans of its window are output as they arrive.
///
/// Real time: on_scan() allocates no memory and does a bounded amount of work. One thread; any
/// thread may read the counters.

#include <array>
#include <cstdint>

#include "abbe/drivers/counter_card/scan.hpp"
#include "abbe/drivers/sample_ring.hpp"
#include "abbe/drivers/sampling/edge_confirmation.hpp"
#include "abbe/drivers/sampling/probe_options.hpp"
#include "abbe/drivers/sampling/scan_history.hpp"
#include "abbe/drivers/status_board.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::drivers {

/// Numbers of events since construction.
struct TouchCounters {
  Counter touches;
  Counter dismissed;      ///< edges whose signal was not stable
  Counter latch_refused;  ///< latched clock counts outside their scan interval
  Counter windows_cut;    ///< windows that the next touch ended early
};

class TouchDetector final : public CounterScanSink {
 public:
  /// Precondition: `options` have passed check(). Allocates.
  explicit TouchDetector(const TouchOptions& options);

  void on_scan(const CounterScan& scan) ABBE_RT override;

  /// Each ring has one reader.
  [[nodiscard]] SampleRing<protocol::ProbeTrigger>& touches() noexcept { return touches_; }
  [[nodiscard]] SampleRing<protocol::TouchScan>& windows() noexcept { return windows_; }
  [[nodiscard]] const TouchCounters& counters() const noexcept { return counters_; }

 private:
  using Event = EdgeConfirmation::Event;

  void restart() ABBE_RT;
  void detect(const CounterScan& before, const CounterScan& scan) ABBE_RT;
  [[nodiscard]] Event detect_edge(const CounterScan& before, const CounterScan& scan) ABBE_RT;
  [[nodiscard]] Event detect_debounced(const CounterScan& before, const CounterScan& scan) ABBE_RT;
  [[nodiscard]] bool latch_moved(const CounterScan& before, const CounterScan& scan) const ABBE_RT;
  [[nodiscard]] EdgeInterval latched_edge(const CounterScan& before,
                                          const CounterScan& scan) ABBE_RT;
  void note(Event event) ABBE_RT;
  void touched() ABBE_RT;
  void rearm_when_free(const CounterScan& scan) ABBE_RT;
  [[nodiscard]] bool retracted(const CounterScan& scan) const ABBE_RT;
  void open_window() ABBE_RT;
  void emit_window() ABBE_RT;

  TouchOptions options_;
  ScanHistory history_;
  EdgeConfirmation edges_;
  SampleRing<protocol::ProbeTrigger> touches_;
  SampleRing<protocol::TouchScan> windows_;
  TouchCounters counters_;

  std::int64_t debounce_counts_ = 0;
  std::int64_t quiet_counts_ = 0;
  std::int64_t after_counts_ = 0;

  bool refused_latest_ = false;     ///< the latched count of this scan's edge is implausible
  bool refused_first_ = false;      ///< the same for the first edge of the pending touch
  bool restarted_pending_ = false;  ///< a restart must be reported with the next touch
  std::uint32_t number_ = 0;
  protocol::ProbeTrigger touch_;  ///< the latest touch
  bool window_open_ = false;
  std::uint64_t window_next_ = 0;  ///< number of the next scan to output
  std::int64_t window_end_ = 0;    ///< clock count at the end of the window
};

}  // namespace abbe::drivers
