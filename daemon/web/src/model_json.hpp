#pragma once
/// A model as JSON for the page. Pure.

#include <nlohmann/json.hpp>

#include "abbe/model/model_document.hpp"

namespace abbe::web {

[[nodiscard]] nlohmann::json model_json(const daemon::ModelDocument& document);

}  // namespace abbe::web
