#pragma once

#include <string>

#include "abbe/base/json_text.hpp"

namespace abbe::daemon {

/// The message as one line of the control API.
inline std::string line_of(const nlohmann::json& message) {
  return json_text(message) + '\n';
}

}  // namespace abbe::daemon
