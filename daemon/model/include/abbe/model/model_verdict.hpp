#pragma once
/// The verdict on a model. It travels with the model in model.json: who gets the file knows whether
/// the gate accepted the model. It is not in model_hash(): a replay finds the same model, but may
/// judge it with other limits or against another active model. model.json protects it by a checksum
/// of its own, which includes the id of the model.

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
  bool accepted = false;             ///< by the gate
  std::vector<std::string> reasons;  ///< of a refusal
  std::vector<std::string> notes{};  ///< no reasons against the model
  /// Who activated the model although the gate had refused it, and why.
  std::optional<StoreActor> forced{};
  friend bool operator==(const ModelVerdict&, const ModelVerdict&) = default;
};

/// NotJudged: models of earlier versions, which have no verdict in their file.
enum class VerdictState { NotJudged, Accepted, Refused, Forced };

[[nodiscard]] VerdictState state_of(const std::optional<ModelVerdict>& verdict) noexcept;
/// "not judged", "accepted", "refused", "forced"
[[nodiscard]] std::string_view name(VerdictState state) noexcept;
/// One line: "refused by the gate: the machine is larger by 418 um/m ...".
[[nodiscard]] std::string in_one_line(const std::optional<ModelVerdict>& verdict);
/// "anna, 2024-05-17T08:30:00.000000000Z (UTC): the reason"
[[nodiscard]] std::string who_and_when(const StoreActor& actor);

[[nodiscard]] ModelVerdict model_verdict(const calib::Verdict& verdict);

}  // namespace abbe::daemon
