#pragma once
/// `abbe verify MODEL MODEL ...`: how well several models predict the same reference points, for
/// example of runs at several feeds.

#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/calib/verify/observe.hpp"
#include "abbe/model/model_document.hpp"
#include "store_option.hpp"

namespace abbe::daemon {

struct NamedModel {
  std::string name;  ///< as given on the command line
  ModelDocument document;
  std::vector<std::string> cautions;  ///< cautions_of()
  calib::Vector3 tool_m = calib::Vector3::Zero();
  std::string machine;  ///< of_machine()
};

/// What several models are compared at.
struct SeveralOptions {
  std::string different_machines;  ///< different_machines(); empty: all are of one machine
  bool json = false;
};

/// Reads the models; `tool`: x,y,z in mm, or empty for the tool of each model. Errors of
/// found_model() and tool_of(). Usage: different tool offsets without `tool`: the points were
/// measured with one.
[[nodiscard]] Result<std::vector<NamedModel>> models_named(const std::vector<std::string>& names,
                                                           const StoreOption& store,
                                                           const std::string& tool);

/// Prints one row per model: residual errors at those places that are inside the validity volume of
/// all models, without and with the model. Returns the exit code: Worse if the errors are larger
/// with one of the models. DataInsufficient: fewer than 4 such places.
[[nodiscard]] Result<int> verify_several(const std::vector<NamedModel>& models,
                                         const calib::verify::Observations& observed,
                                         const SeveralOptions& options);

}  // namespace abbe::daemon
