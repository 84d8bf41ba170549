#pragma once
/// The sequence numbers that the reliable readers of this participant can use now, for each remote
/// writer. Fast DDS keeps each number received out of order, and counts one by one up to the first
/// number of a heartbeat. A foreign participant could thereby exhaust its memory or block it. The
/// limits come from the ACKNACKs, in which each reader states the number that it waits for.
/// Thread-safe.

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <mutex>
#include <optional>
#include <span>

namespace abbe::dds {

class SequenceWindow {
 public:
  using WriterGuid = std::array<std::uint8_t, 16>;

  /// A reader requests 256 numbers at a time, and abbe-dds keeps 128 samples per topic. Numbers
  /// further ahead are not lost: the writer repeats them when they are requested.
  static constexpr std::uint64_t kAhead = 1024;
  /// The same limit for announcements and other messages of a participant, which are kept whole.
  static constexpr std::uint64_t kAnnouncementsAhead = 32;
  /// Most numbers that the heartbeats of all writers may skip in one second; Fast DDS needs about
  /// 20 ms to count them. Further numbers are skipped with later heartbeats. With 15 devices
  /// abbe-dds writes this number of Health samples in three days.
  static constexpr std::uint64_t kLongestSkip = std::uint64_t{1} << 22;
  /// A heartbeat may always skip this many numbers, those of lost samples.
  static constexpr std::uint64_t kShortSkip = 1024;
  /// Most writers that are stored. Beyond this number, the writers that were first requested
  /// longest ago are removed until they are requested again.
  static constexpr std::size_t kMostWriters = 16384;

  /// Reads the ACKNACKs of a message that this participant sends.
  void sent(std::span<const std::uint8_t> message);

  /// The number that a reader waits for; nullopt: no reader has requested anything from this
  /// writer, for example because it is a best-effort writer.
  [[nodiscard]] std::optional<std::uint64_t> next_of(const WriterGuid& writer) const;

  /// The number of `wanted` numbers that a heartbeat may skip now.
  [[nodiscard]] std::uint64_t take_skip(std::uint64_t wanted) const;

 private:
  using Instant = std::chrono::steady_clock::time_point;

  mutable std::mutex mutex_;
  mutable std::uint64_t skips_left_ =
      kLongestSkip;  ///< number that remains until the second that began at skips_since_ is over
  mutable Instant skips_since_{};
  std::map<WriterGuid, std::uint64_t> next_;
  std::deque<WriterGuid> order_;  ///< keys of next_, the oldest first
};

}  // namespace abbe::dds
