#pragma once
/// Makes the content of model.json from the solution of a ball-array identification. Pure.

#include <vector>

#include "abbe/base/input_file.hpp"
#include "abbe/calib/evemu/solve/solve.hpp"
#include "abbe/config/config.hpp"
#include "abbe/methods/evemu/identification.hpp"
#include "abbe/model/model_document.hpp"

namespace abbe::daemon {

[[nodiscard]] ModelDocument evemu_document(const calib::evemu::Solution& solution,
                                           const Config& config, std::vector<InputFile> inputs,
                                           protocol::UtcTime created);

/// Same as the function above, with the figures of the run in addition: verdict, residuals, places
/// of the balls (RunFigures).
[[nodiscard]] ModelDocument evemu_document(const EvemuCandidate& candidate, const Config& config,
                                           std::vector<InputFile> inputs,
                                           protocol::UtcTime created);

}  // namespace abbe::daemon
