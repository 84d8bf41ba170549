#pragma once
/// Decodes the bytes of a sender of lines into samples, in SI units and host time. Sans-I/O and
/// deterministic: the same bytes with the same arrival times give the same samples, live or
/// replayed. Real time: allocation-free, no system call. One thread. Up to 2 MB: keep it on the
/// heap.
///
/// Raw blocks: a block FromDevice holds bytes as received; an empty one records a new connection.
/// An empty block ToDevice records a lost connection. A recording may begin within a line: until
/// the first new connection everything up to the first end of a line is discarded. The clock model
/// observes the last sample of each read, so a replay joins the blocks of one read
/// (RawBlock::continued) before it pushes them; see LineBlocks.

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "abbe/drivers/clock_model.hpp"
#include "abbe/drivers/lines/contents.hpp"
#include "abbe/drivers/tracker/burst_times.hpp"
#include "abbe/protocol/lines/line_framer.hpp"
#include "abbe/protocol/rt.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::drivers {

/// `Content`: what the lines hold; see contents.hpp.
template <class Content>
struct LineReceiverOptionsOf {
  typename Content::Format format;
  /// Format without a time column: max_constant_delay bounds the delay from the measurement to the
  /// arrival of each line.
  ClockModelOptions clock;
  /// As in BurstTimes.
  std::chrono::nanoseconds time_separation{};
  /// Format without a time column: duration of the measurement whose mean a line is.
  std::chrono::nanoseconds stationary_time = Content::kUsualDuration;
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
  std::uint64_t points = 0;      ///< lines that were read
  std::uint64_t headings = 0;    ///< comments, and names of columns; see is_comment(), is_heading()
  std::uint64_t unreadable = 0;  ///< lines that cannot be read
  BurstTimeCounters times;
};

/// What a receiver has found so far.
struct LineReception {
  LineCounters counters;
  UnreadableLine unreadable;
  double skew_beyond_limit = 0.0;  ///< as in ClockModel
  /// Mean interval of the latest kRateCount lines with a time, if most intervals are not the
  /// configured one; else 0.
  std::chrono::nanoseconds other_separation{};
  bool invalid = false;   ///< the latest line was invalid, and Content::kStatusIsCondition
  bool together = false;  ///< format without a time column: most lines come with others
};

template <class Content>
class LineReceiverOf {
 public:
  using Sample = typename Content::Sample;
  using Options = LineReceiverOptionsOf<Content>;

  explicit LineReceiverOf(const Options& options);
  LineReceiverOf(const LineReceiverOf&) = delete;
  LineReceiverOf& operator=(const LineReceiverOf&) = delete;

  /// Adds all bytes of one read and their arrival time; a call without bytes marks a new
  /// connection. The bytes must stay valid until next() has returned no samples.
  void push(std::span<const std::byte> bytes, protocol::HostTime arrival) ABBE_RT;
  /// To be called where bytes of a recording are missing: searches for the next line, and marks the
  /// next sample GapBefore.
  void bytes_lost() ABBE_RT;

  /// The samples of the lines that are complete, at most kMostSamples; valid until the next call.
  /// Empty: more bytes are needed.
  [[nodiscard]] std::span<const Sample> next() ABBE_RT;
  static constexpr std::size_t kMostSamples = BurstTimesOf<TimedHead>::kMostPoints;

  [[nodiscard]] LineCounters counters() const ABBE_RT;
  [[nodiscard]] const UnreadableLine& unreadable() const ABBE_RT { return found_.unreadable; }
  [[nodiscard]] LineReception findings() const ABBE_RT;
  [[nodiscard]] ClockStatus clock() const ABBE_RT { return times_.clock(); }
  static constexpr std::uint32_t kRateCount = 200;

 private:
  void connection_began() ABBE_RT;
  [[nodiscard]] std::optional<lines::FramedLine> next_line() ABBE_RT;
  void take(const lines::FramedLine& line) ABBE_RT;
  void refuse(std::string_view line, lines::LineFault fault) ABBE_RT;
  void judge_rate(protocol::DeviceTime t) ABBE_RT;
  [[nodiscard]] std::size_t set_times(std::size_t count) ABBE_RT;
  [[nodiscard]] std::size_t set_times_by_arrival(std::size_t count) ABBE_RT;
  void judge_togetherness(std::size_t count) ABBE_RT;
  void mark_gap_of_arrivals(TimedHead& timed) ABBE_RT;

  Options options_;
  bool has_time_;
  lines::LineFramer framer_;
  BurstTimesOf<TimedHead> times_;
  LineReception found_;  ///< except what times_ counts
  protocol::HostTime arrival_{};
  bool datagram_ends_ = false;  ///< with the bytes pushed last
  bool first_line_ = true;      ///< of the connection
  std::size_t count_ = 0;       ///< samples gathered by next()
  std::optional<protocol::DeviceTime> rate_last_;
  protocol::DeviceTime rate_begin_{};
  std::uint32_t rate_steps_ = 0;
  std::uint32_t rate_other_ = 0;
  // Without a time column.
  std::optional<protocol::HostTime> last_by_arrival_;
  std::size_t lines_in_reads_ = 0;
  std::size_t reads_with_lines_ = 0;
  std::array<TimedHead, kMostSamples> heads_{};
  std::array<Sample, kMostSamples> samples_{};
};

using LineReceiver = LineReceiverOf<LinePoints>;
using LineReceiverOptions = LineReceiver::Options;
using LineAxisReceiver = LineReceiverOf<LineAxes>;

/// Decodes recorded blocks: gives the receiver whole reads, as the device does. Not real time.
template <class Receiver>
class LineBlocks {
 public:
  explicit LineBlocks(const typename Receiver::Options& options) : receiver_(options) {}

  /// Passes each span of samples that is complete with this block to `samples`.
  template <class Take>
  void take(const protocol::RawBlock& block, Take samples) {
    if (block.direction != protocol::RawBlock::Direction::FromDevice) return;
    if (block.lost_before > 0) {
      read_.clear();
      receiver_.bytes_lost();
    }
    const auto bytes = std::span{block.bytes}.first(block.length);
    read_.insert(read_.end(), bytes.begin(), bytes.end());
    if (block.continued) return;

    receiver_.push(read_, block.time);
    for (auto next = receiver_.next(); !next.empty(); next = receiver_.next()) samples(next);
    read_.clear();
  }

 private:
  Receiver receiver_;
  std::vector<std::byte> read_;
};

}  // namespace abbe::drivers
