#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "abbe/base/error.hpp"

namespace abbe::web {

/// {"state": "failed", "error": TEXT}
[[nodiscard]] nlohmann::json failed_with(std::string text);
/// The error with its details, each on a line of its own.
[[nodiscard]] std::string failure_text(const daemon::Error& error);

}  // namespace abbe::web
