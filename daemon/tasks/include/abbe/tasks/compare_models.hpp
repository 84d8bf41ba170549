#pragma once
/// The difference of two models in the volume where both are valid.

#include <cstddef>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/calib/model/model_comparison.hpp"
#include "abbe/tasks/model_source.hpp"

namespace abbe::daemon {

/// Names of the models, and the direction of travel "+,-,0"; empty: not known.
struct CompareModelsArguments {
  std::string a, b, direction;
  StoreOption store{};
  bool other_machine = false;
};

struct ModelsComparison {
  std::size_t points = 0;
  calib::ModelDifference difference;
  std::vector<std::string> cautions_a, cautions_b;
  std::string machine_a, machine_b;
  std::string different_machines;  ///< empty: they are the same
};

/// Usage: models of different machines that `other_machine` does not allow. DataInsufficient: the
/// models have no common volume.
[[nodiscard]] Result<ModelsComparison> compare_models(const CompareModelsArguments&);

}  // namespace abbe::daemon
