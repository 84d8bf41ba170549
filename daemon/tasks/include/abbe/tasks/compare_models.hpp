#pragma once
/// The difference of two models in the volume where both are valid.

#include <cstddef>
#include <string>

#include "abbe/base/error.hpp"
#include "abbe/calib/model/model_comparison.hpp"
#include "abbe/tasks/same_machine.hpp"

namespace abbe::daemon {

/// Names of the models, and the direction of travel "+,-,0"; empty: not known.
struct CompareModelsArguments {
  std::string a, b, direction;
  StoreOption store{};
  bool other_machine = false;
};

struct ModelsComparison {
  ComparedModel a, b;
  std::size_t points = 0;
  calib::ModelDifference difference;
  /// text that the models are of different machines; empty: they are of the same machine
  std::string different_machines;
};

/// Usage: no second model, or models of different machines although `other_machine` is false.
/// DataInsufficient: the models have no common volume.
[[nodiscard]] Result<ModelsComparison> compare_models(const CompareModelsArguments&);

}  // namespace abbe::daemon
