#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace abbe::daemon {

/// One line of the control API. Devices and file names may hold bytes that are no UTF-8: replaced,
/// never thrown.
inline std::string line_of(const nlohmann::json& message) {
  return message.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + '\n';
}

}  // namespace abbe::daemon
