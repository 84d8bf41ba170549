#pragma once
/// The summary of `abbe identify mfb`.

#include <filesystem>
#include <nlohmann/json.hpp>

#include "abbe/methods/mfb/identification.hpp"
#include "abbe/model/model_document.hpp"

namespace abbe::daemon {

[[nodiscard]] nlohmann::json mfb_json(const ModelDocument& document, const MfbCandidate& candidate,
                                      const std::filesystem::path& folder);
void print_mfb_summary(const ModelDocument& document, const MfbCandidate& candidate,
                       const std::filesystem::path& folder);

}  // namespace abbe::daemon
