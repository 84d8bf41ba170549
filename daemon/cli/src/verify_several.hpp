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
};

/// Reads the models; `tool`: x,y,z in mm, or empty for the tool of each model. Errors of
/// model_named() and tool_of(). Usage: different tool offsets without `tool`: the points were measured
/// with one.
[[nodiscard]] Result<std::vector<NamedModel>> models_named(const std::vector<std::string>& names,
                                                           const StoreOption& store,
                                                           const std::string& tool);

/// Prints one row per model: residual errors at those points that are inside the validity volume of
/// all models, without and with the model. DataInsufficient: fewer than 4 such points.
[[nodiscard]] Result<void> verify_several(const std::vector<NamedModel>& models,
                                          const calib::verify::Observations& observed, bool json);

}  // namespace abbe::daemon
