#include "abbe/drivers/sampling/touch_detector.hpp"

#include <algorithm>
#include <utility>

#include "abbe/drivers/sampling/touch_position.hpp"

namespace abbe::drivers {

namespace {

using protocol::SampleFlag;
using protocol::TouchFlag;

// Limits the work of one call: with each new scan, at most this many scans of a window are output.
constexpr int kWindowScansPerScan = 4;

EdgeInterval between(const CounterScan& before, const CounterScan& scan) noexcept {
  return {before.clock_count, scan.clock_count, false};
}

protocol::TouchScan window_scan(const CounterScan& scan, std::uint32_t touch) noexcept {
  protocol::TouchScan w;
  w.head = scan.axes.head;
  w.touch = touch;
  w.axis_count = scan.axes.axis_count;
  w.missing_mask = scan.axes.missing_mask;
  w.clock_count = scan.clock_count;
  w.latch_count = scan.latch_count;
  w.edge_count = scan.edge_count;
  w.count = scan.axes.count;
  w.position = scan.axes.position;
  return w;
}

}  // namespace

void TouchDetector::on_scan(const CounterScan& scan) ABBE_RT {
  if (has(scan.axes.head.flags, SampleFlag::Restarted)) restart();
  const bool first = history_.empty();
  // If the clock does not advance, edges cannot be located, and detection restarts. The card's
  // receiver reports the fault.
  if (!first && scan.clock_count <= history_.newest().clock_count) return restart();
  history_.push(scan);
  if (!first) detect(history_.scan(history_.end_number() - 2), scan);
  emit_window();
}

void TouchDetector::restart() ABBE_RT {
  restarted_pending_ = true;
  history_.clear();
  edges_.rearm();
  window_open_ = false;
}

void TouchDetector::detect(const CounterScan& before, const CounterScan& scan) ABBE_RT {
  refused_latest_ = false;
  note(debounce_counts_ > 0 ? detect_debounced(before, scan) : detect_edge(before, scan));
  if (edges_.state() == EdgeConfirmation::State::Touched) rearm_when_free(scan);
}

bool TouchDetector::latch_moved(const CounterScan& before, const CounterScan& scan) const ABBE_RT {
  return options_.wiring.use_latch && scan.latched &&
         (!before.latched || scan.latch_count != before.latch_count);
}

EdgeInterval TouchDetector::latched_edge(const CounterScan& before,
                                         const CounterScan& scan) ABBE_RT {
  const std::int64_t h = scan.latch_half_width;
  // Tolerance of one count: edge and scan may be in the same period of the clock.
  const bool plausible = scan.latch_count + h + 1 >= before.clock_count &&
                         scan.latch_count - h - 1 <= scan.clock_count;
  if (plausible) return {scan.latch_count - h, scan.latch_count + h, true};
  refused_latest_ = true;
  counters_.latch_refused.add();
  return between(before, scan);
}

EdgeConfirmation::Event TouchDetector::detect_edge(const CounterScan& before,
                                                   const CounterScan& scan) ABBE_RT {
  const std::int64_t counted = scan.edge_count - before.edge_count;
  const bool moved = latch_moved(before, scan);
  if (counted <= 0 && !moved) return edges_.on_time(scan.clock_count);
  EdgeInterval edge = moved ? latched_edge(before, scan) : between(before, scan);
  // The latch holds the last edge of this scan, but the touch is the first: it may lie anywhere
  // between the previous scan and the last edge.
  if (counted > 1) edge = {before.clock_count, std::max(before.clock_count, edge.to), false};
  return edges_.on_edge(edge, counted > 1);
}

EdgeConfirmation::Event TouchDetector::detect_debounced(const CounterScan& before,
                                                        const CounterScan& scan) ABBE_RT {
  Event event = Event::Nothing;
  if (latch_moved(before, scan)) {
    event = edges_.on_edge(latched_edge(before, scan), false);
  }
  if (scan.edge_count > before.edge_count) {
    note(event);
    return edges_.on_counted(
        {before.clock_count - debounce_counts_, scan.clock_count - debounce_counts_, false});
  }
  return event == Event::Nothing ? edges_.on_time(scan.clock_count) : event;
}

void TouchDetector::note(Event event) ABBE_RT {
  switch (event) {
    case Event::Nothing:
      return;
    case Event::Began:
      refused_first_ = refused_latest_;
      return;
    case Event::Dismissed:
      refused_first_ = refused_latest_;
      counters_.dismissed.add();
      return;
    case Event::Confirmed:
      return touched();
  }
}

void TouchDetector::touched() ABBE_RT {
  touch_ = locate_touch(edges_.first(), history_, options_);
  touch_.touch = ++number_;
  if (edges_.chattered()) touch_.touch_flags |= TouchFlag::Chattered;
  if (refused_first_) touch_.touch_flags |= TouchFlag::LatchRefused;
  if (std::exchange(restarted_pending_, false)) touch_.head.flags |= SampleFlag::Restarted;
  counters_.touches.add();
  touches_.try_push(touch_);
  open_window();
}

bool TouchDetector::retracted(const CounterScan& scan) const ABBE_RT {
  // Without positions or an approach direction the retraction is unknown; only the time without
  // edges is then decisive.
  if (touch_.missing_mask != 0 || scan.axes.missing_mask != 0 || touch_.speed_m_s == 0.0)
    return true;
  double back_m = 0.0;
  for (std::size_t i = 0; i < touch_.axis_count; ++i) {
    if (((options_.wiring.linear_axes >> i) & 1u) == 0) continue;
    back_m += (touch_.position[i] - scan.axes.position[i]) * touch_.velocity[i] / touch_.speed_m_s;
  }
  return back_m >= options_.switching.rearm_retract_m;
}

void TouchDetector::rearm_when_free(const CounterScan& scan) ABBE_RT {
  if (scan.clock_count - edges_.last_edge() >= quiet_counts_ && retracted(scan)) edges_.rearm();
}

void TouchDetector::open_window() ABBE_RT {
  if (window_open_) counters_.windows_cut.add();
  const auto contact = history_.instant(touch_.edge_clock_count) - options_.delay.delay;
  window_open_ = true;
  window_next_ = history_.first_after(contact - options_.window_before);
  window_end_ = touch_.edge_clock_count + after_counts_;
}

void TouchDetector::emit_window() ABBE_RT {
  if (!window_open_) return;
  window_next_ = std::max(window_next_, history_.begin_number());
  for (int i = 0; i < kWindowScansPerScan && window_next_ < history_.end_number();
       ++i, ++window_next_) {
    const CounterScan& scan = history_.scan(window_next_);
    if (scan.clock_count > window_end_) {
      window_open_ = false;
      return;
    }
    windows_.try_push(window_scan(scan, touch_.touch));
  }
}

}  // namespace abbe::drivers
