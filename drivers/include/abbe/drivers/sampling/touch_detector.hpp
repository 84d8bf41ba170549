#pragma once
/// Touches out of the scans of a counter card: first edge, confirmation, position at the contact,
/// re-arming on retract; and the scans around every touch. A CounterScanSink: live and in a replay
/// the same scans give the same touches. A touch leaves when it is confirmed, its window as the
/// scans come.
///
/// Real time: on_scan() takes no memory and does a bounded amount of work. One thread; counters are
/// for any.

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

/// Since construction.
struct TouchCounters {
  Counter touches;
  Counter dismissed;      ///< edges that did not stand
  Counter latch_refused;  ///< a latched clock that lies outside of its scan
  Counter windows_cut;    ///< windows that ended early because the next touch came
};

class TouchDetector final : public CounterScanSink {
 public:
  /// `options` have passed check(). Allocates.
  explicit TouchDetector(const TouchOptions& options);

  void on_scan(const CounterScan& scan) ABBE_RT override;

  /// One reader each.
  [[nodiscard]] SampleRing<protocol::ProbeTrigger>& touches() noexcept { return touches_; }
  [[nodiscard]] SampleRing<protocol::TouchScan>& windows() noexcept { return windows_; }
  [[nodiscard]] const TouchCounters& counters() const noexcept { return counters_; }

 private:
  using Event = EdgeConfirmation::Event;

  void restart() ABBE_RT;
  void look(const CounterScan& before, const CounterScan& scan) ABBE_RT;
  [[nodiscard]] Event look_at_every_edge(const CounterScan& before,
                                         const CounterScan& scan) ABBE_RT;
  [[nodiscard]] Event look_at_debounced(const CounterScan& before, const CounterScan& scan) ABBE_RT;
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

  bool refused_latest_ = false;     ///< the edge of this scan had no usable latch
  bool refused_first_ = false;      ///< the edge the pending touch began with
  bool restarted_pending_ = false;  ///< for the next touch
  std::uint32_t number_ = 0;
  protocol::ProbeTrigger touch_;  ///< the latest
  bool window_open_ = false;
  std::uint64_t window_next_ = 0;  ///< number of the scan to come next
  std::int64_t window_end_ = 0;    ///< clock count of the last one
};

}  // namespace abbe::drivers
