#pragma once
/// The difference of models of two machines says nothing about either of them. Commands that
/// compare models refuse such a pair, unless --other-machine states that it is meant.

#include <span>
#include <string>
#include <vector>

#include "abbe/tasks/model_source.hpp"

namespace abbe::daemon {

/// What is compared, and its machine.
struct OfMachine {
  std::string what;  ///< for people: "a.json", "run.mcap"
  std::string machine;
};
/// The machine of a model: the name in its configuration; of a model from the data folder of
/// another machine, with a remark.
[[nodiscard]] OfMachine of_machine(const std::string& name, const FoundModel& model);

/// A sentence that names the machines; empty if all are the same one.
[[nodiscard]] std::string different_machines(std::span<const OfMachine> compared);
/// Usage if the machines differ and `other_machine` is false; else different_machines().
[[nodiscard]] Result<std::string> require_same_machine(const std::string& command,
                                                       std::span<const OfMachine> compared,
                                                       bool other_machine);

/// A model that is compared with measurements or with other models.
struct ComparedModel {
  std::string name;  ///< as a person gives it
  ModelDocument document;
  std::vector<std::string> cautions;  ///< cautions_of()
  std::string machine;                ///< of_machine()
};

/// Errors of found_model().
[[nodiscard]] Result<ComparedModel> compared_model(const std::string& name,
                                                   const StoreOption& where);

}  // namespace abbe::daemon
