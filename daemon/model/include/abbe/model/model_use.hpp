#pragma once
/// States the reasons against the use of a model, and what its user must know. All code that passes
/// a model on (control files, certificates, reports, the page, Python) calls these functions, so
/// that all of it applies the same reasons. A new reason is added in obstacles_to_use() only. Pure.

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/model/model_store.hpp"

namespace abbe::daemon {

/// The purpose for which a model is used. Control: the model corrects a machine from now on.
/// Certificate: a document states how the machine was when it was measured. Look: reports and
/// figures. For Look nothing is refused: all reasons are in Obstacles::statements, the verdict
/// first.
enum class ModelPurpose { Control, Certificate, Look };

/// A model, with information that its document does not contain.
struct ModelInUse {
  const ModelDocument& document;  ///< document with the verdict of its file or store
  /// events of this model, oldest first; empty: the model is in no store
  std::span<const StoreEvent> events{};
  /// machine_hash() of the configuration of the machine that will use the model; nullopt: not
  /// known.
  std::optional<std::string> machine_hash{};
  ModelPurpose purpose = ModelPurpose::Control;
  /// identity_doubt() of the store of the model; empty: nothing speaks against the model, or no
  /// identity is known.
  std::string identity_doubt{};
};

/// True if the model was made for another configuration than that of `machine_hash`, and no person
/// has accepted it for this one. False if the configuration is not known.
[[nodiscard]] bool is_of_another_machine(const ModelInUse& use);

/// Sentences without full stop; none has a line break or a control character.
struct Obstacles {
  std::vector<std::string> refusals;    ///< the model must not be used, unless a person forces it
  std::vector<std::string> statements;  ///< must be written into each file made from the model
};
[[nodiscard]] Obstacles obstacles_to_use(const ModelInUse& use);

/// The statements that a file made from the model must contain: the refusals, with who forced the
/// use and why, then the statements. If there are refusals and `forced` is empty, the result is an
/// Error Refused with all of them. `what` is the attempted action, "export model.json".
[[nodiscard]] Result<std::vector<std::string>> statements_of_use(
    const std::string& what, const Obstacles& obstacles, const std::optional<StoreActor>& forced);

}  // namespace abbe::daemon
