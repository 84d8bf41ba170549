#pragma once
/// A model that is compared with measurements or with other models.

#include <string>
#include <vector>

#include "abbe/tasks/same_machine.hpp"

namespace abbe::daemon {

struct ComparedModel {
  std::string name;  ///< as it was given to compared_model()
  ModelDocument document;
  std::vector<std::string> cautions;  ///< cautions_of()
  std::string machine;                ///< of_machine()
};

/// Errors of found_model().
[[nodiscard]] Result<ComparedModel> compared_model(const std::string& name,
                                                   const StoreOption& where);

}  // namespace abbe::daemon
