#pragma once
/// Identifies a model with a ball array: from touches, from errors that another program computed,
/// or from a recording.

#include <optional>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/methods/evemu/identification.hpp"
#include "abbe/model/model_document.hpp"
#include "abbe/tasks/evemu_input.hpp"
#include "abbe/tasks/progress.hpp"

namespace abbe::daemon {

struct IdentifyEvemuArguments {
  EvemuInputArguments input;
  std::string keep;  ///< store with whose active model the gate compares; or empty
  std::optional<std::string> estimator, folds;  ///< default: the value of [evemu]
  bool accept_shape_only = false;
  std::vector<std::string> accept{};  ///< see accept_also()
};

struct EvemuOutcome {
  EvemuCandidate candidate;
  ModelDocument document;
};
[[nodiscard]] Result<EvemuOutcome> identify_evemu(const IdentifyEvemuArguments&, const Progress&);

}  // namespace abbe::daemon
