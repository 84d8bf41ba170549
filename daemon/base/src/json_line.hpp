#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace abbe::daemon {

/// One line of the control API. Invalid UTF-8, which device messages and file names may contain, is
/// replaced; nothing is thrown.
inline std::string line_of(const nlohmann::json& message) {
  return message.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + '\n';
}

}  // namespace abbe::daemon
