#pragma once
/// The verdict on a model. It is stored in model.json, so that the receiver of the file knows
/// whether the gate accepted the model. It is not in model_hash(): a replay finds the same model,
/// but may judge it with other limits or against another active model. A separate checksum in
/// model.json protects it, which includes the id of the model.

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/calib/model/gate.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::daemon {

/// User, reason and time of a change. Kept permanently.
struct StoreActor {
  std::string who;
  std::string why;
  protocol::UtcTime when{};
  bool operator==(const StoreActor&) const = default;
};

struct ModelVerdict {
  bool accepted = false;             ///< true: the gate accepted the model
  std::vector<std::string> reasons;  ///< reasons of a refusal
  std::vector<std::string> notes{};  ///< remarks that are no reasons against the model
  /// The person who activated the model although the gate had refused it, and the reason.
  std::optional<StoreActor> forced{};
  friend bool operator==(const ModelVerdict&, const ModelVerdict&) = default;
};

/// NotJudged: the model is from an earlier version, without a verdict in its file.
enum class VerdictState { NotJudged, Accepted, Refused, Forced };

[[nodiscard]] VerdictState state_of(const std::optional<ModelVerdict>& verdict) noexcept;
/// "not judged", "accepted", "refused", "forced"
[[nodiscard]] std::string_view name(VerdictState state) noexcept;
/// The verdict in one line: "refused by the gate: the machine is larger by 418 um/m ...".
[[nodiscard]] std::string in_one_line(const std::optional<ModelVerdict>& verdict);
/// "anna, 2024-05-17T08:30:00.000000000Z (UTC): the reason"
[[nodiscard]] std::string who_and_when(const StoreActor& actor);

[[nodiscard]] ModelVerdict model_verdict(const calib::Verdict& verdict);

}  // namespace abbe::daemon
