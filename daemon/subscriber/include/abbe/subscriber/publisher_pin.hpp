#pragma once
/// Decides which participant a subscriber uses when several DDS participants publish data under the
/// same machine name. Two things are pinned:
/// - the identity of the machine (machine_id of the topic Identity): the machine_id that was given,
///   else the first one received. It does not change during the life of this object. Another
///   machine of the same name is never used;
/// - the participant: the first one with this identity, until it stops sending. While two
///   publishers have the same identity (a copied disk), no new participant is chosen.
/// An abbe-dds of an earlier version has no topic Identity: it is used by its name alone if no
/// machine_id was given and no publisher states one.
/// The header uses the standard library only, so that subscribers can copy it; publisher_pin.h has
/// the same rule in C.
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
#include <string_view>
#include <utility>
#include <vector>

namespace abbe::dds {

/// Identifies a DDS participant: the GUID prefix that all of its writers share
/// [DDSI-RTPS 2.5, 8.2.4.2].
using ParticipantId = std::array<std::uint8_t, 12>;

/// The id in the format of Fast DDS and Cyclone DDS, for example "010f4e2a.8c1f0100.00000000".
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

/// The kind of another publisher that a machine has detected, from the members twin and twin_seen
/// of Identity.
enum class Twin {
  None,
  Other,   ///< another machine of this name, or this machine_id under another name
  SameId,  ///< another publisher of this name and machine_id
};

/// Beginning of twin_seen if the other publisher has the same machine_id; its name and a comma
/// follow.
inline constexpr std::string_view kTwinOfSameId = "the same machine_id, as machine ";

/// `machine`: the name in this Identity.
[[nodiscard]] inline Twin twin_of(bool twin, std::string_view twin_seen,
                                  const std::string& machine) {
  if (!twin) return Twin::None;
  const std::string copy = std::string(kTwinOfSameId) + machine + ",";
  return twin_seen.substr(0, copy.size()) == copy ? Twin::SameId : Twin::Other;
}

/// Create one object per machine.
class PublisherPin {
 public:
  using Instant = std::chrono::steady_clock::time_point;

  /// Another participant can be pinned once the pinned one has sent nothing for this time: 15 or
  /// more samples are then missing, because abbe sends at 50 to 100 Hz. A subscriber that reads
  /// only topics that are repeated every second needs kSilenceOfSlowTopics.
  static constexpr std::chrono::milliseconds kSilence{300}, kSilenceOfSlowTopics{1500};
  /// Another participant is pinned only if it has sent for kAlone while the pinned one sent
  /// nothing. Of each interval between two of its samples at most kLongestPause is counted: a
  /// subscriber that was suspended thereby receives again from the pinned participant before it
  /// pins another.
  static constexpr std::chrono::milliseconds kAlone{30}, kLongestPause{10};
  /// Another participant is foreign if the pinned one still sends this long after the other's first
  /// sample. The successor of a restarted publisher is never foreign, because the old process has
  /// ended before the new one sends.
  static constexpr std::chrono::milliseconds kOverlap{100};
  /// Identity is sent every second. A participant that has sent other topics for kNoIdentity
  /// without an Identity is regarded as having none. A participant whose Identity came within
  /// kPresent is regarded as present.
  static constexpr std::chrono::milliseconds kNoIdentity{5000}, kPresent{1500};
  /// Most participants that are stored in addition to the pinned one. For a further participant,
  /// the one with the oldest last sample is removed.
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
    /// Do not use the sample, and report it: two publishers have this machine_id, or two have the
    /// name and none states an identity.
    Copied,
    /// Do not use the sample, and report it: its machine_id is empty, because abbed could neither
    /// read nor make one.
    Unidentified,
  };

  /// `machine_id`: identity of the machine that this subscriber belongs to. Empty: the first
  /// received identity is pinned.
  explicit PublisherPin(std::string machine_id = {}, std::chrono::milliseconds silence = kSilence)
      : silence_(silence) {
    if (!machine_id.empty()) machine_id_ = std::move(machine_id);
  }

  /// Call it for every sample of the topic Identity.
  Verdict identified(const ParticipantId& from, const std::string& machine_id, Twin twin,
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
    if (const auto objection = objection_to(other, now)) return *objection;
    const bool silent = now - pinned_heard_ >= silence_ && other.alone >= kAlone;
    return !pinned_ || silent ? pin(other, now) : Verdict::Waiting;
  }

  [[nodiscard]] const std::optional<ParticipantId>& pinned() const noexcept { return pinned_; }

  /// The machine_id that was given or pinned first; nullopt: none yet, or the pinned participant
  /// states none.
  [[nodiscard]] const std::optional<std::string>& machine_id() const noexcept {
    return machine_id_;
  }

  /// The machine_id that participant `id` states; nullopt: none so far, as from an abbe-dds of a
  /// version before the topic Identity.
  [[nodiscard]] std::optional<std::string> stated_by(const ParticipantId& id) const {
    if (pinned_ == id) return machine_id_;
    const auto found = std::ranges::find(others_, id, &Other::id);
    if (found == others_.end() || !found->states) return std::nullopt;
    return found->states->machine_id;
  }

  /// True if `id` is the pinned participant or a stored one; if false, its samples need not be
  /// kept.
  [[nodiscard]] bool remembers(const ParticipantId& id) const {
    return pinned_ == id || std::ranges::find(others_, id, &Other::id) != others_.end();
  }

 private:
  struct Statement {
    std::string machine_id;
    Twin twin = Twin::None;
  };
  struct Other {
    ParticipantId id;
    Instant first, last;
    /// time for which this participant alone has sent, since the last sample of the pinned one
    std::chrono::nanoseconds alone{};
    bool foreign = false;
    std::optional<Statement> states;
  };

  /// The reason why `other` must not be pinned now, whether or not the pinned participant is
  /// silent.
  [[nodiscard]] std::optional<Verdict> objection_to(const Other& other, Instant now) const {
    if (!other.states) {
      if (machine_id_ || now - other.first < kNoIdentity) return Verdict::Waiting;
      if (std::ranges::any_of(others_, [](const Other& o) { return o.states.has_value(); }))
        return Verdict::Waiting;
    } else {
      const auto& [machine_id, twin] = *other.states;
      if (machine_id.empty()) return Verdict::Unidentified;
      if (machine_id_ && machine_id != *machine_id_) return Verdict::OtherMachine;
      if (twin == Twin::SameId && !is_of_foreign(machine_id, now)) return Verdict::Copied;
      if (!machine_id_ && twin == Twin::Other) return Verdict::Ambiguous;
    }
    if (other.foreign) return Verdict::Foreign;
    if (has_copy(other, now)) return Verdict::Copied;
    return std::nullopt;
  }

  /// True if a foreign participant that is present states this identity. It is then the copy that
  /// the restarted publisher sees.
  [[nodiscard]] bool is_of_foreign(const std::string& machine_id, Instant now) const {
    return std::ranges::any_of(others_, [&](const Other& o) {
      return o.foreign && o.states && o.states->machine_id == machine_id && now - o.last < kPresent;
    });
  }

  /// True if another participant has the same identity, and is neither pinned nor foreign to the
  /// pinned one.
  [[nodiscard]] bool has_copy(const Other& of, Instant now) const {
    const auto id = [](const Other& o) {
      return o.states ? std::optional{o.states->machine_id} : std::nullopt;
    };
    return std::ranges::any_of(others_, [&](const Other& o) {
      return o.id != of.id && !o.foreign && now - o.last < kPresent && id(o) == id(of);
    });
  }

  Verdict pin(const Other& next, Instant now) {
    const ParticipantId id = next.id;
    if (next.states) machine_id_ = next.states->machine_id;
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

  std::chrono::milliseconds silence_;
  std::optional<std::string> machine_id_;
  std::optional<ParticipantId> pinned_;
  Instant pinned_heard_{};
  std::vector<Other> others_;
};

}  // namespace abbe::dds
