#pragma once
/// Which sequence numbers the reliable readers of this participant can use now, by remote writer.
/// Fast DDS keeps each number that it received out of order, and counts one by one to the first
/// number of a heartbeat: a stranger could make it need all memory or stop it. A reader states in
/// each ACKNACK which number it waits for. Thread-safe.

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

  /// A reader asks for 256 numbers at a time, and abbe-dds has 128 samples a topic. Numbers that
  /// lie further ahead are not lost: the writer repeats them when they are asked for.
  static constexpr std::uint64_t kAhead = 1024;
  /// The same for announcements and other messages of a participant, which are kept whole.
  static constexpr std::uint64_t kAnnouncementsAhead = 32;
  /// Most numbers that the heartbeats of all writers may skip in a second, some 20 ms of counting.
  /// Further ones follow with the next heartbeats. With 15 devices abbe-dds writes so many samples
  /// of Health in three days.
  static constexpr std::uint64_t kLongestSkip = std::uint64_t{1} << 22;
  /// So many numbers a heartbeat may skip always: those of lost samples.
  static constexpr std::uint64_t kShortSkip = 1024;
  /// Of further writers those that were first asked longest ago are forgotten, until they are asked
  /// again.
  static constexpr std::size_t kMostWriters = 16384;

  /// Reads the ACKNACKs of a message that this participant sends.
  void sent(std::span<const std::uint8_t> message);

  /// The number that a reader waits for; nullopt: none has asked this writer yet, for example
  /// because it is a best-effort writer.
  [[nodiscard]] std::optional<std::uint64_t> next_of(const WriterGuid& writer) const;

  /// How many of `wanted` numbers a heartbeat may skip now.
  [[nodiscard]] std::uint64_t take_skip(std::uint64_t wanted) const;

 private:
  using Instant = std::chrono::steady_clock::time_point;

  mutable std::mutex mutex_;
  mutable std::uint64_t skips_left_ =
      kLongestSkip;  ///< until the second since skips_since_ is over
  mutable Instant skips_since_{};
  std::map<WriterGuid, std::uint64_t> next_;
  std::deque<WriterGuid> order_;  ///< of next_, the oldest entry first
};

}  // namespace abbe::dds
