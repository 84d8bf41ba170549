#pragma once
/// Looks for other publishers in the domain that claim to be this machine: the same name with
/// another identity (a copied configuration), or the same identity (a copied disk). abbe-dds reads
/// the topic Identity of all participants for this, and remembers the last claims of this name or
/// identity: strangers that publish other ones do not hide a twin. Used by one thread.

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
  /// A publisher repeats its Identity every second. One that was silent for longer is gone.
  static constexpr std::chrono::seconds kGone{5};
  static constexpr std::chrono::milliseconds kPeriod{100};

  /// `participant` must outlive this object. Without a reader, because permissions of DDS Security
  /// from an earlier version do not allow it, no twin is seen; looks() is then false.
  explicit TwinWatch(Participant& participant);

  [[nodiscard]] bool looks() const noexcept { return readers_.has_value(); }

  /// Reads what has arrived, at most every kPeriod. `own`: the payload of the last Identity that
  /// this participant published; empty: none yet. Returns in words the twin that was seen first,
  /// one of the same identity before one of the same name, and how many there are; empty: none.
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
