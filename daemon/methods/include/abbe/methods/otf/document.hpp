#pragma once
/// Makes the content of model.json from the solution of an on-the-fly identification. Pure.

#include <vector>

#include "abbe/base/input_file.hpp"
#include "abbe/calib/otf/solve/solve.hpp"
#include "abbe/config/config.hpp"
#include "abbe/methods/otf/identification.hpp"
#include "abbe/model/model_document.hpp"

namespace abbe::daemon {

[[nodiscard]] ModelDocument otf_document(const calib::otf::Solution& solution,
                                         calib::otf::Mode mode, const Config& config,
                                         std::vector<InputFile> inputs, protocol::UtcTime created);

/// Same as the function above, with the figures of the run in addition: verdict and residuals along
/// the path (RunFigures).
[[nodiscard]] ModelDocument otf_document(const OtfCandidate& candidate, const Config& config,
                                         std::vector<InputFile> inputs, protocol::UtcTime created);

}  // namespace abbe::daemon
