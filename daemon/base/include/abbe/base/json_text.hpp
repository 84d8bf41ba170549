#pragma once
/// JSON as text. File names, devices and the network may contain bytes that are not UTF-8: each is
/// replaced by U+FFFD. nlohmann's dump() would throw an exception. No other function of abbe calls
/// dump().

#include <nlohmann/json.hpp>
#include <string>

namespace abbe::daemon {

/// One line, without a newline at its end.
template <class Json>
[[nodiscard]] std::string json_text(const Json& value) {
  return value.dump(-1, ' ', false, Json::error_handler_t::replace);
}

/// Several lines, each level indented by one space.
template <class Json>
[[nodiscard]] std::string indented_json_text(const Json& value) {
  return value.dump(1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace abbe::daemon
