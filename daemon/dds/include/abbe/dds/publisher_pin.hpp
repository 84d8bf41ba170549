#pragma once
/// Decides which participant a subscriber uses when several DDS participants publish data of the
/// same machine: the one from which the first sample arrives is pinned until it stops sending. The
/// header uses the standard library only, so that subscribers can copy it; the Cyclone DDS example
/// implements the same rule in C.
///
/// The rule protects against a participant that starts later. It does not protect against one that
/// starts first, one that takes over after the pinned one has stopped, or one that forges the GUID:
/// daemon/docs/dds.md, "Strangers". Pure; used by one thread.

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <optional>
#include <string>
#include <vector>

namespace abbe::dds {

/// Identifies a DDS participant: the GUID prefix that all of its writers share
/// [DDSI-RTPS 2.5, 8.2.4.2].
using ParticipantId = std::array<std::uint8_t, 12>;

/// In the format of Fast DDS and Cyclone DDS, for example "010f4e2a.8c1f0100.00000000".
[[nodiscard]] inline std::string text_of(const ParticipantId& id) {
  std::string text;
  for (std::size_t i = 0; i < id.size(); ++i) {
    std::array<char, 4> byte{};
    std::snprintf(byte.data(), byte.size(), "%s%02x", i % 4 == 0 && i > 0 ? "." : "",
                  unsigned{id[i]});
    text += byte.data();
  }
  return text;
}

/// Create one object per machine.
class PublisherPin {
 public:
  using Instant = std::chrono::steady_clock::time_point;

  /// Another participant can be pinned once the pinned one has sent nothing for this time: 15 or
  /// more samples are then missing, because abbe sends at 50 to 100 Hz.
  static constexpr std::chrono::milliseconds kSilence{300};
  /// Another participant is pinned only if it has sent for kAlone while the pinned one sent
  /// nothing. Of each interval between two of its samples at most kLongestPause is counted: a
  /// subscriber that was suspended thereby receives again from the pinned participant before it
  /// pins another.
  static constexpr std::chrono::milliseconds kAlone{30}, kLongestPause{10};
  /// Another participant is foreign if the pinned one still sends this long after the other's first
  /// sample. The successor of a restarted publisher is never foreign, because the old process has
  /// ended before the new one sends.
  static constexpr std::chrono::milliseconds kOverlap{100};
  /// A foreign participant is pinned only after the pinned one has sent nothing for this time.
  static constexpr std::chrono::seconds kSilenceForForeign{10};
  /// At most this many participants beside the pinned one are remembered. For a further one, that
  /// with the oldest last sample is forgotten.
  static constexpr std::size_t kMostOthers = 7;

  enum class Verdict {
    Pinned,  ///< use the sample
    /// use the sample and earlier ones of this participant; discard those of the previous one
    NewlyPinned,
    Waiting,  ///< keep the sample, do not use it
    Foreign,  ///< keep the sample, do not use it, and report the participant
  };

  /// Call it for every received sample of this machine, on any topic. `from`: the participant that
  /// sent it.
  Verdict heard(const ParticipantId& from, Instant now) {
    if (pinned_ == from) {
      pinned_heard_ = now;
      for (Other& other : others_) {
        other.foreign |= now - other.first >= kOverlap;
        other.alone = {};
      }
      return Verdict::Pinned;
    }

    if (!pinned_) return pin(from, now);
    Other& other = find_or_add(from, now);
    other.alone += std::min<std::chrono::nanoseconds>(now - other.last, kLongestPause);
    other.last = now;
    const std::chrono::nanoseconds silence = other.foreign ? kSilenceForForeign : kSilence;
    if (now - pinned_heard_ >= silence && other.alone >= kAlone) return pin(from, now);

    return other.foreign ? Verdict::Foreign : Verdict::Waiting;
  }

  [[nodiscard]] const std::optional<ParticipantId>& pinned() const noexcept { return pinned_; }

  /// Whether `id` is the pinned participant or a remembered one; if not, its samples need not be
  /// kept.
  [[nodiscard]] bool remembers(const ParticipantId& id) const {
    return pinned_ == id || std::ranges::find(others_, id, &Other::id) != others_.end();
  }

 private:
  struct Other {
    ParticipantId id;
    Instant first, last;
    std::chrono::nanoseconds alone{};  ///< since the last sample of the pinned participant
    bool foreign = false;
  };

  Verdict pin(const ParticipantId& id, Instant now) {
    std::erase_if(others_, [&](const Other& other) { return other.id == id; });
    pinned_ = id;
    pinned_heard_ = now;
    return Verdict::NewlyPinned;
  }

  Other& find_or_add(const ParticipantId& id, Instant now) {
    const auto found = std::ranges::find(others_, id, &Other::id);
    if (found != others_.end()) return *found;
    if (others_.size() == kMostOthers)
      others_.erase(std::ranges::min_element(others_, {}, &Other::last));
    return others_.emplace_back(Other{id, now, now});
  }

  std::optional<ParticipantId> pinned_;
  Instant pinned_heard_{};
  std::vector<Other> others_;
};

}  // namespace abbe::dds
