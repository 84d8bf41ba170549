#pragma once
/// Converts the count of a latch channel to the count of the clock channel at the same instant.
/// Both count the same clock, but were zeroed at different moments:
///     latch = clock + offset
/// With the card's own timer as the clock the offset is 0. Otherwise each edge bounds it: the edge
/// lies between two scans, so the offset lies in an interval as long as the scan period. The offset
/// lies in the intersection of the intervals of all edges. No I/O; real time, one thread.

#include <cstdint>
#include <optional>

#include "abbe/protocol/quad08/stream.hpp"
#include "abbe/protocol/rt.hpp"

namespace abbe::drivers {

class LatchTracker {
 public:
  /// `in_step`: the clock is the card's own timer, so both counters start together with it: offset
  /// 0.
  LatchTracker(protocol::quad08::CountWidth width, bool in_step) ABBE_RT : width_(width),
                                                                           in_step_(in_step) {
    reset();
  }

  /// Call it when the counters were zeroed.
  void reset() ABBE_RT;
  /// Starts in the middle of a stream: `latch_raw` is the present reading, which is not a new edge.
  void begin_at(std::uint64_t latch_raw) ABBE_RT { last_raw_ = latch_raw; }

  struct Latch {
    std::int64_t clock_count = 0;  ///< unwrapped, of the clock channel
    std::int64_t half_width = 0;   ///< the true value is clock_count +- half_width
  };
  /// Call it for every scan in order, with the readings of both channels and the unwrapped clock
  /// counts of this and of the previous scan. True: the latch has changed since the previous scan.
  bool on_scan(std::uint64_t latch_raw, std::uint64_t clock_raw, std::int64_t clock_count,
               std::int64_t previous_clock_count) ABBE_RT;
  /// The latest latch; nullopt before the first edge.
  [[nodiscard]] std::optional<Latch> latest() const ABBE_RT { return latest_; }
  /// Number of latches outside the scan interval in which their edge was seen: the latch channel
  /// counts another clock, or the input does not latch as assumed.
  [[nodiscard]] std::uint64_t disagreements() const ABBE_RT { return disagreements_; }

 private:
  /// Bounds of the difference latch count - clock count at one instant.
  struct Offset {
    std::int64_t low = 0;
    std::int64_t high = 0;
  };
  void narrow(const Offset& seen) ABBE_RT;

  protocol::quad08::CountWidth width_;
  bool in_step_;
  std::uint64_t last_raw_ = 0;
  std::optional<Offset> offset_;
  std::optional<Latch> latest_;
  std::uint64_t disagreements_ = 0;
};

}  // namespace abbe::drivers
