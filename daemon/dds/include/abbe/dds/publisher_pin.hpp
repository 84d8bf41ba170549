#pragma once
/// Decides which participant a subscriber uses when several DDS participants publish data under the
/// same machine name. Two things are pinned:
/// - the identity of the machine (machine_id of the topic Identity): the one that was given, else
///   the first one, for the life of this object. Another machine of the same name is never used;
/// - the participant: the first one of this identity, until it stops sending.
/// The header uses the standard library only, so that subscribers can copy it; the Cyclone DDS
/// example implements the same rule in C.
///
/// The rule protects against a participant that starts later. Without DDS Security it does not
/// protect against one that forges the identity and starts first or takes over after the pinned one
/// has stopped, or one that forges the GUID: daemon/docs/dds.md, "Strangers". Pure; used by one
/// thread.

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <optional>
#include <string>
#include <utility>
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
  /// At most this many participants beside the pinned one are remembered. For a further one, that
  /// with the oldest last sample is forgotten.
  static constexpr std::size_t kMostOthers = 7;

  enum class Verdict {
    Pinned,  ///< use the sample
    /// use the sample and earlier ones of this participant; discard those of the previous one
    NewlyPinned,
    Waiting,  ///< keep the sample, do not use it
    /// Keep the sample, do not use it, and report the participant: it sent beside the pinned one,
    /// and will not be pinned.
    Foreign,
    /// Do not use the sample, and report the participant: it publishes for another machine.
    OtherMachine,
    /// Do not use the sample, and report it: two machines have this name, and the subscriber was
    /// not given the machine_id of one of them.
    Ambiguous,
  };

  /// `machine_id`: of the machine that this subscriber is for. Empty: the first one is pinned.
  explicit PublisherPin(std::string machine_id = {}) {
    if (!machine_id.empty()) machine_id_ = std::move(machine_id);
  }

  /// Call it for every sample of the topic Identity. `twin`: its member of this name.
  Verdict identified(const ParticipantId& from, const std::string& machine_id, bool twin,
                     Instant now) {
    if (pinned_ == from && machine_id != machine_id_) pinned_.reset();
    if (pinned_ != from) find_or_add(from, now).states = Statement{machine_id, twin};
    return heard(from, now);
  }

  /// Call it for every received sample of this machine, on any other topic. `from`: the participant
  /// that sent it.
  Verdict heard(const ParticipantId& from, Instant now) {
    if (pinned_ == from) {
      pinned_heard_ = now;
      for (Other& other : others_) {
        other.foreign |= now - other.first >= kOverlap;
        other.alone = {};
      }
      return Verdict::Pinned;
    }

    Other& other = find_or_add(from, now);
    other.alone += std::min<std::chrono::nanoseconds>(now - other.last, kLongestPause);
    other.last = now;
    if (!other.states) return Verdict::Waiting;
    if (machine_id_ && other.states->machine_id != *machine_id_) return Verdict::OtherMachine;
    if (!machine_id_ && other.states->twin) return Verdict::Ambiguous;
    if (other.foreign) return Verdict::Foreign;
    const bool silent = now - pinned_heard_ >= kSilence && other.alone >= kAlone;
    return !pinned_ || silent ? pin(other, now) : Verdict::Waiting;
  }

  [[nodiscard]] const std::optional<ParticipantId>& pinned() const noexcept { return pinned_; }

  /// The machine_id that was given or pinned first; nullopt: none yet.
  [[nodiscard]] const std::optional<std::string>& machine_id() const noexcept {
    return machine_id_;
  }

  /// What `id` states: its machine_id; nullopt: nothing yet, as an abbe-dds of before this topic.
  [[nodiscard]] std::optional<std::string> stated_by(const ParticipantId& id) const {
    if (pinned_ == id) return machine_id_;
    const auto found = std::ranges::find(others_, id, &Other::id);
    if (found == others_.end() || !found->states) return std::nullopt;
    return found->states->machine_id;
  }

  /// Whether `id` is the pinned participant or a remembered one; if not, its samples need not be
  /// kept.
  [[nodiscard]] bool remembers(const ParticipantId& id) const {
    return pinned_ == id || std::ranges::find(others_, id, &Other::id) != others_.end();
  }

 private:
  struct Statement {
    std::string machine_id;
    bool twin = false;
  };
  struct Other {
    ParticipantId id;
    Instant first, last;
    std::chrono::nanoseconds alone{};  ///< since the last sample of the pinned participant
    bool foreign = false;
    std::optional<Statement> states;
  };

  Verdict pin(const Other& next, Instant now) {
    const ParticipantId id = next.id;
    machine_id_ = next.states->machine_id;
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
    return others_.emplace_back(Other{.id = id, .first = now, .last = now});
  }

  std::optional<std::string> machine_id_;
  std::optional<ParticipantId> pinned_;
  Instant pinned_heard_{};
  std::vector<Other> others_;
};

}  // namespace abbe::dds
