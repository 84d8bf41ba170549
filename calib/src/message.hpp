#pragma once
/// Concatenates the pieces of an error text; numbers have six significant digits.

#include <sstream>
#include <string>

namespace abbe::calib {

template <class... Pieces>
[[nodiscard]] std::string message(const Pieces&... pieces) {
  std::ostringstream out;
  (out << ... << pieces);
  return out.str();
}

}  // namespace abbe::calib
