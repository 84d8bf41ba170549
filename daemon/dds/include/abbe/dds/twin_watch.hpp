#pragma once
/// Looks for other publishers in the domain that claim to be this machine: with the same name and
/// another identity (a copied configuration), or with the same identity (a copied disk). For this,
/// abbe-dds reads the topic Identity of all participants. It stores only the last claims of this
/// name or this identity, so that other publishers in any number do not hide such a twin. Used by
/// one thread.

#include <chrono>
#include <cstddef>
#include <map>
#include <optional>
#include <span>
#include <string>

#include "abbe/dds/readers.hpp"
#include "abbe_v1.h"

namespace abbe::dds {

class TwinWatch {
 public:
  using Instant = std::chrono::steady_clock::time_point;
  /// A publisher repeats its Identity every second. A publisher that was silent for longer than
  /// kGone no longer counts.
  static constexpr std::chrono::seconds kGone{5};
  static constexpr std::chrono::milliseconds kPeriod{100};

  /// `participant` must outlive this object. Permissions of DDS Security from an earlier version
  /// may not allow the reader. Then no twin is detected, and looks() returns false.
  explicit TwinWatch(Participant& participant);

  [[nodiscard]] bool looks() const noexcept { return readers_.has_value(); }

  /// Reads the Identities that have arrived, at most once per kPeriod. `own`: the payload of the
  /// last Identity that this participant published; empty: none yet. Returns a text with the number
  /// of twins and the twin that was seen first; a twin with the same identity comes before one with
  /// the same name. Empty: no twin.
  [[nodiscard]] std::string cycle(std::span<const std::byte> own, Instant now);

 private:
  struct Claim {
    std::string machine, machine_id;
    Instant first, last;
  };
  void take(const Arrival& arrival, const v1::Identity& own, Instant now);
  [[nodiscard]] static bool is_twin(const Claim& claim, const v1::Identity& own);
  [[nodiscard]] static bool has_id_of(const Claim& claim, const v1::Identity& own);
  [[nodiscard]] std::string in_words(const v1::Identity& own) const;

  ParticipantId self_{};
  std::optional<Readers> readers_;
  std::map<ParticipantId, Claim> claims_;
  Instant next_{};
  std::string seen_;
};

}  // namespace abbe::dds
