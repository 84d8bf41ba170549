#pragma once
/// Makes the content of model.json from an identification with a Multi-Feature Bar. Pure.

#include <vector>

#include "abbe/base/input_file.hpp"
#include "abbe/config/config.hpp"
#include "abbe/methods/mfb/identification.hpp"
#include "abbe/model/model_document.hpp"

namespace abbe::daemon {

/// The name of the feature in the file of touches: "hole", "rod" or "plane".
[[nodiscard]] std::string_view name(calib::mfb::Feature feature);

[[nodiscard]] ModelDocument mfb_document(const MfbCandidate& candidate,
                                         calib::mfb::Estimator estimator, const Config& config,
                                         std::vector<InputFile> inputs, protocol::UtcTime created);

}  // namespace abbe::daemon
