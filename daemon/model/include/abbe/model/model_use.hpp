#pragma once
/// What stands against the use of a model, and what its user must know. Everything that lets a
/// model leave abbe (control files, certificates, reports, the page, Python) asks here, so that a
/// state that one part knows is not lost in the next. A new obstacle is added in obstacles_to_use()
/// only. Pure.

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/model/model_store.hpp"

namespace abbe::daemon {

/// Control: the model corrects a machine from now on. Certificate: it states how the machine was
/// when it was measured. Look: reports and figures, which show everything and refuse nothing: all
/// of it is in Obstacles::statements, the verdict first.
enum class ModelPurpose { Control, Certificate, Look };

/// A model with what is known beside its document.
struct ModelInUse {
  const ModelDocument& document;         ///< with the verdict of its file or store
  std::span<const StoreEvent> events{};  ///< of this model, oldest first; empty: it is in no store
  /// machine_hash() of the configuration of the machine that will use the model; nullopt: not
  /// known.
  std::optional<std::string> machine_hash{};
  ModelPurpose purpose = ModelPurpose::Control;
  /// identity_doubt() of the store of the model; empty: there is none, or no identity is known.
  std::string identity_doubt{};
};

/// True if the model was made for another configuration than that of `machine_hash`, and nobody
/// accepted it for this one. False if the configuration is not known.
[[nodiscard]] bool is_of_another_machine(const ModelInUse& use);

/// Sentences without full stop; none has a line break or a control character.
struct Obstacles {
  std::vector<std::string> refusals;    ///< the model must not be used, unless a person forces it
  std::vector<std::string> statements;  ///< belong into each file that is made of the model
};
[[nodiscard]] Obstacles obstacles_to_use(const ModelInUse& use);

/// What a file that is made of the model states: the refusals, with who forced the use and why,
/// then the statements. Refused with all refusals if there are any and `forced` is empty; `what`
/// was tried:
/// "export model.json".
[[nodiscard]] Result<std::vector<std::string>> statements_of_use(
    const std::string& what, const Obstacles& obstacles, const std::optional<StoreActor>& forced);

}  // namespace abbe::daemon
