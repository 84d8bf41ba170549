#pragma once
/// Checks that compared models belong to the same machine. The difference of models of two machines
/// has no meaning for either of them. Commands that compare models refuse such a pair unless the
/// option --other-machine allows it.

#include <span>
#include <string>
#include <vector>

#include "abbe/tasks/model_source.hpp"

namespace abbe::daemon {

/// An object that is compared, and its machine.
struct OfMachine {
  std::string what;  ///< name of the object in messages: "a.json", "run.mcap"
  std::string machine;
};
/// The machine of a model: the name in its configuration, with a remark if the model comes from the
/// data folder of another machine.
[[nodiscard]] OfMachine of_machine(const std::string& name, const FoundModel& model);

/// A sentence that names the machines; empty if all objects belong to the same machine.
[[nodiscard]] std::string different_machines(std::span<const OfMachine> compared);
/// Usage if the machines differ and `other_machine` is false; else different_machines().
[[nodiscard]] Result<std::string> require_same_machine(const std::string& command,
                                                       std::span<const OfMachine> compared,
                                                       bool other_machine);

/// A model that is compared with measurements or with other models.
struct ComparedModel {
  std::string name;  ///< name as given by the user
  ModelDocument document;
  std::vector<std::string> cautions;  ///< cautions_of()
  std::string machine;                ///< of_machine()
};

/// Reads the model. Errors are those of found_model().
[[nodiscard]] Result<ComparedModel> compared_model(const std::string& name,
                                                   const StoreOption& where);

}  // namespace abbe::daemon
