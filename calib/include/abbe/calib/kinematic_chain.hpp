#pragma once
/// The order in which a machine's axes carry each other, from a chain string in the style of ISO
/// 10791-6: `[w X' b Y Z (C1) t]`: w workpiece, b bed, t tool; a prime marks an axis that carries
/// the workpiece; parentheses mean present, but not moving. For the volumetric error only the order
/// of X, Y, Z read from w to t matters, because all error tables describe tool relative to
/// workpiece, primed axis or not.

#include <array>
#include <cstddef>
#include <string>
#include <string_view>

#include "abbe/calib/error.hpp"

namespace abbe::calib {

enum class Axis : std::size_t { X = 0, Y = 1, Z = 2 };
inline constexpr std::array<Axis, 3> kAllAxes{Axis::X, Axis::Y, Axis::Z};
[[nodiscard]] constexpr std::size_t index(Axis a) {
  return static_cast<std::size_t>(a);
}
[[nodiscard]] constexpr char letter(Axis a) {
  return static_cast<char>('X' + static_cast<char>(index(a)));
}

/// A machine of three linear axes. Immutable value; default: X, Y, Z from workpiece to tool, all on
/// the tool side.
class KinematicChain {
 public:
  KinematicChain() = default;

  /// Needs w first, t last, b once, each of X, Y, Z once and moving; axes before b primed, axes
  /// after b not. Other axes and spindles (A1, (C1), S ...) are allowed and ignored. BadInput says
  /// which of these is broken, and where.
  [[nodiscard]] static Result<KinematicChain> parse(std::string_view text);

  [[nodiscard]] const std::string& text() const { return text_; }
  [[nodiscard]] const std::array<Axis, 3>& order_w_to_t() const { return order_; }
  /// 0: next to the workpiece, 2: next to the tool.
  [[nodiscard]] std::size_t place(Axis a) const;
  [[nodiscard]] bool carries_workpiece(Axis a) const { return primed_[index(a)]; }

 private:
  std::string text_ = "[w b X Y Z t]";
  std::array<Axis, 3> order_{Axis::X, Axis::Y, Axis::Z};
  std::array<bool, 3> primed_{};
};

}  // namespace abbe::calib
