#pragma once
/// Which sequence numbers the reliable readers of this participant can use now, by remote writer.
/// Fast DDS keeps each number that it received out of order, and counts one by one to the first
/// number of a heartbeat: a stranger could make it need all memory or stop it. A reader states in
/// each ACKNACK which number it waits for. Thread-safe.

#include <array>
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
  /// Most numbers that one heartbeat may skip, some 20 ms of counting. Further ones follow with the
  /// next heartbeats: abbe-dds needs more than a week for so many.
  static constexpr std::uint64_t kLongestSkip = std::uint64_t{1} << 22;
  /// Of further writers those that were first asked longest ago are forgotten, until they are asked
  /// again.
  static constexpr std::size_t kMostWriters = 16384;

  /// Reads the ACKNACKs of a message that this participant sends.
  void sent(std::span<const std::uint8_t> message);

  /// The number that a reader waits for; nullopt: none has asked this writer yet, for example
  /// because it is a best-effort writer.
  [[nodiscard]] std::optional<std::uint64_t> next_of(const WriterGuid& writer) const;

 private:
  mutable std::mutex mutex_;
  std::map<WriterGuid, std::uint64_t> next_;
  std::deque<WriterGuid> order_;  ///< of next_, the oldest entry first
};

}  // namespace abbe::dds
