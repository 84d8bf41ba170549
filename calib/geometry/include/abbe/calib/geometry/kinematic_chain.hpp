#pragma once
/// Kinematic chain of a machine: the order of its axes, parsed from a string in the style of ISO
/// 10791-6, for example
///     [w X' b Y Z (C1) t]
/// w: workpiece, b: bed, t: tool. A prime marks an axis that carries the workpiece. Parentheses
/// mark an axis that is present but does not move. The volumetric error depends only on the order
/// of X, Y, Z from w to t: all error tables describe the tool relative to the workpiece, for primed
/// axes, too.

#include <array>
#include <cstddef>
#include <string>
#include <string_view>

#include "abbe/calib/base/error.hpp"

namespace abbe::calib {

enum class Axis : std::size_t { X = 0, Y = 1, Z = 2 };
inline constexpr std::array<Axis, 3> kAllAxes{Axis::X, Axis::Y, Axis::Z};
[[nodiscard]] constexpr std::size_t index(Axis a) {
  return static_cast<std::size_t>(a);
}
[[nodiscard]] constexpr char letter(Axis a) {
  return static_cast<char>('X' + static_cast<char>(index(a)));
}

/// Chain of a machine with three linear axes. Immutable value. Default: X, Y, Z from workpiece to
/// tool, all three between bed and tool.
class KinematicChain {
 public:
  KinematicChain() = default;

  /// w must be first, t last, b must occur once, X, Y and Z must occur once each and without
  /// parentheses. Axes before b must have a prime, axes after b must not. Other axes and spindles
  /// (A1, (C1), S ...) are permitted and ignored. The text of BadInput names the rule that is
  /// broken and the token.
  [[nodiscard]] static Result<KinematicChain> parse(std::string_view text);

  [[nodiscard]] const std::string& text() const { return text_; }
  [[nodiscard]] const std::array<Axis, 3>& order_w_to_t() const { return order_; }
  /// Position in the order from w to t. 0: next to the workpiece, 2: next to the tool.
  [[nodiscard]] std::size_t place(Axis a) const;

 private:
  std::string text_ = "[w b X Y Z t]";
  std::array<Axis, 3> order_{Axis::X, Axis::Y, Axis::Z};
};

}  // namespace abbe::calib
