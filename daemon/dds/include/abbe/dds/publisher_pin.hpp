#pragma once
/// Which of several DDS participants that publish as one machine a subscriber follows: the one it
/// heard first, until that one is silent. Standard library only, for subscribers to copy; the
/// Cyclone DDS example has the same rule in C. It keeps out a participant that comes later, not one
/// that is there first, one that takes over after a silence, or one that forges the GUID:
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

/// A DDS participant by the prefix of its GUID, which all of its writers share
/// [DDSI-RTPS 2.5, 8.2.4.2].
using ParticipantId = std::array<std::uint8_t, 12>;

/// As Fast DDS and Cyclone DDS print it, for instance "010f4e2a.8c1f0100.00000000".
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

/// One for every machine.
class PublisherPin {
 public:
  using Instant = std::chrono::steady_clock::time_point;

  /// The pinned participant sent nothing for so long: another one may be the next. abbe sends at 50
  /// to 100 Hz.
  static constexpr std::chrono::milliseconds kSilence{300};
  /// The next one has sent alone for so long. Pauses between its samples count up to kLongestPause,
  /// so that a subscriber that stood still itself hears the pinned one before it takes another.
  static constexpr std::chrono::milliseconds kAlone{30}, kLongestPause{10};
  /// Two participants that both sent within so long: the other one is a foreign. A restarted
  /// publisher never is, because the one before has ended.
  static constexpr std::chrono::milliseconds kOverlap{100};
  /// A foreign is accepted after this silence of the pinned one, and not before.
  static constexpr std::chrono::seconds kSilenceForRival{10};
  /// So many are remembered; the one heard longest ago is forgotten.
  static constexpr std::size_t kMostOthers = 7;

  enum class Verdict {
    Pinned,  ///< use the sample
    /// use the sample, and what this participant sent before; nothing of the one before
    NewlyPinned,
    Waiting,  ///< keep what it sent, do not use it
    Foreign,  ///< the same, and report it
  };

  /// A sample of this machine, on any topic, came from `from`.
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
    const std::chrono::nanoseconds silence = other.foreign ? kSilenceForRival : kSilence;
    if (now - pinned_heard_ >= silence && other.alone >= kAlone) return pin(from, now);

    return other.foreign ? Verdict::Foreign : Verdict::Waiting;
  }

  [[nodiscard]] const std::optional<ParticipantId>& pinned() const noexcept { return pinned_; }

  /// Of others nothing needs to be kept.
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
