#pragma once
/// The drift of the tracker in the summary of `abbe identify otf`.

#include <nlohmann/json.hpp>
#include <string>

#include "abbe/model/model_document.hpp"

namespace abbe::daemon {

[[nodiscard]] std::string tracker_drift_text(const TrackerDriftFigures&);
[[nodiscard]] nlohmann::json tracker_drift_json(const TrackerDriftFigures&);

}  // namespace abbe::daemon
