#pragma once
/// Decodes the bytes of a sender of lines into tracker points, in SI units and host time.
/// Sans-I/O and deterministic: the same bytes with the same arrival times give the same samples,
/// live or replayed. Real time: allocation-free, no system call. One thread. About 700 kB: keep it
/// on the heap.
///
/// Raw blocks: a block FromDevice holds bytes as received; an empty one records a new connection.
/// An empty block ToDevice records a lost connection. A recording may begin within a line: until
/// the first new connection everything up to the first end of a line is discarded. The clock model
/// observes the last point of each read, so a replay joins the blocks of one read
/// (RawBlock::continued) before it pushes them.

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "abbe/drivers/clock_model.hpp"
#include "abbe/drivers/tracker/burst_times.hpp"
#include "abbe/protocol/lines/line_framer.hpp"
#include "abbe/protocol/lines/tracker_line.hpp"
#include "abbe/protocol/rt.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::drivers {

namespace lines = protocol::lines;

struct LineReceiverOptions {
  lines::LineFormat format;
  ClockModelOptions clock;
  /// As in BurstTimes.
  std::chrono::nanoseconds time_separation{};
  /// Format without a time column: duration of the measurement whose mean a line is.
  std::chrono::nanoseconds stationary_time = std::chrono::milliseconds{500};
  bool datagrams = false;        ///< each read is a datagram, whose end ends a line
  bool begins_anywhere = false;  ///< a connection may begin within a line (serial lines)
};

/// The latest line that could not be read.
struct UnreadableLine {
  lines::LineFault fault;
  std::array<char, 96> begin{};  ///< its first bytes
  std::size_t length = 0;
  [[nodiscard]] std::string_view text() const ABBE_RT { return {begin.data(), length}; }
};

/// Counts since construction.
struct LineCounters {
  std::uint64_t points = 0;
  std::uint64_t headings = 0;    ///< comments, and names of columns; see is_comment(), is_heading()
  std::uint64_t unreadable = 0;  ///< lines that are no point
  BurstTimes::Counters times;
};

class LineReceiver {
 public:
  explicit LineReceiver(const LineReceiverOptions& options) noexcept;
  LineReceiver(const LineReceiver&) = delete;
  LineReceiver& operator=(const LineReceiver&) = delete;

  /// Adds all bytes of one read and their arrival time; a call without bytes marks a new
  /// connection. The bytes must stay valid until next() has returned no points.
  void push(std::span<const std::byte> bytes, protocol::HostTime arrival) ABBE_RT;
  /// To be called where bytes of a recording are missing: searches for the next line, and marks the
  /// next sample GapBefore.
  void bytes_lost() ABBE_RT;

  /// The points of the lines that are complete, at most BurstTimes::kMostPoints; valid until the
  /// next call. Empty: more bytes are needed.
  [[nodiscard]] std::span<const protocol::TrackerPoint> next() ABBE_RT;

  [[nodiscard]] LineCounters counters() const ABBE_RT;
  [[nodiscard]] const UnreadableLine& unreadable() const ABBE_RT { return unreadable_; }
  [[nodiscard]] ClockStatus clock() const ABBE_RT { return times_.clock(); }
  [[nodiscard]] double skew_beyond_limit() const ABBE_RT { return times_.skew_beyond_limit(); }
  /// Mean interval of the latest kRateCount points with a time, if most intervals are not the
  /// configured one; else 0.
  [[nodiscard]] std::chrono::nanoseconds other_separation() const ABBE_RT {
    return other_separation_;
  }
  static constexpr std::uint32_t kRateCount = 200;

 private:
  void connection_began() ABBE_RT;
  [[nodiscard]] std::optional<lines::FramedLine> next_line() ABBE_RT;
  void take(const lines::FramedLine& line) ABBE_RT;
  void refuse(std::string_view line, lines::LineFault fault) ABBE_RT;
  void judge_rate(protocol::DeviceTime t) ABBE_RT;

  LineReceiverOptions options_;
  lines::LineFramer framer_;
  BurstTimes times_;
  LineCounters counters_;  ///< except those of times_
  UnreadableLine unreadable_;
  protocol::HostTime arrival_{};
  bool datagram_ends_ = false;  ///< with the bytes pushed last
  bool first_line_ = true;      ///< of the connection
  std::size_t count_ = 0;       ///< points gathered by next()
  std::optional<protocol::DeviceTime> rate_last_;
  protocol::DeviceTime rate_begin_{};
  std::uint32_t rate_steps_ = 0;
  std::uint32_t rate_other_ = 0;
  std::chrono::nanoseconds other_separation_{};
  std::array<protocol::TrackerPoint, BurstTimes::kMostPoints> points_{};
};

}  // namespace abbe::drivers
