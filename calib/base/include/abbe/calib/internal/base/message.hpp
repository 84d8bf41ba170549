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

/// A number with two significant digits, for values that only show a size.
[[nodiscard]] inline std::string two_digits(double value) {
  std::ostringstream out;
  out.precision(2);
  out << value;
  return out.str();
}

/// Text of a vector in metres, such as "(20, -15, -120) mm".
template <class Vector>
[[nodiscard]] std::string mm_text(const Vector& v_m) {
  constexpr double kMmPerM = 1e3;
  return message("(", kMmPerM * v_m[0], ", ", kMmPerM * v_m[1], ", ", kMmPerM * v_m[2], ") mm");
}

}  // namespace abbe::calib
