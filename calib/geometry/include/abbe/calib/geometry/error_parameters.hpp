#pragma once
/// Names of geometric errors as in ISO 230-1. A name consists of `E`, the direction of the error
/// motion (X Y Z: translation, A B C: rotation about x y z) and the moving axis:
/// - EXX: positioning error of X; EYX, EZX: straightness errors of X,
/// - EAX: roll of X; EBX, ECX: pitch and yaw of X.
/// Squareness: EA0Z and EB0Z are tilts of the direction of motion of Z, EC0Y is the tilt of the
/// direction of Y. X is the primary direction, XY the secondary plane. Sign of all errors:
/// V = actual - nominal, tool relative to workpiece.

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

#include "abbe/calib/geometry/kinematic_chain.hpp"

namespace abbe::calib {

/// Quantity in an error table: translation along x y z [m] or rotation about x y z [rad].
enum class Motion : std::size_t { X = 0, Y = 1, Z = 2, A = 3, B = 4, C = 5 };
inline constexpr std::array<Motion, 6> kAllMotions{Motion::X, Motion::Y, Motion::Z,
                                                   Motion::A, Motion::B, Motion::C};
[[nodiscard]] constexpr bool is_rotation(Motion m) {
  return static_cast<std::size_t>(m) >= 3;
}
/// Direction of the translation, or of the rotation vector: 0, 1, 2 for x, y, z.
[[nodiscard]] constexpr std::size_t direction(Motion m) {
  return static_cast<std::size_t>(m) % 3;
}

/// One error motion of one axis, a function of that axis' position.
struct ErrorMotion {
  Motion motion = Motion::X;
  Axis axis = Axis::X;
  friend bool operator==(const ErrorMotion&, const ErrorMotion&) = default;
};
[[nodiscard]] std::string name(ErrorMotion e);
[[nodiscard]] std::optional<ErrorMotion> error_motion(std::string_view iso_name);
/// EXX, EYY, EZZ.
[[nodiscard]] bool is_positioning(ErrorMotion e);
/// The six translations that are not positioning errors.
[[nodiscard]] bool is_straightness(ErrorMotion e);

/// Squareness errors in the order in which every parameter vector contains them.
inline constexpr std::array<std::string_view, 3> kSquarenessNames{"EA0Z", "EB0Z", "EC0Y"};

/// One identified parameter with its name, as stored and reported. Rotations and squareness errors
/// are in rad, all others in m.
struct Parameter {
  /// "EXX", "EC0Y", or "k_exz2": coefficient of the scaled design of [Li OMM], always in m
  std::string name;
  std::optional<double> position_m;  ///< node on its axis; nullopt for squareness and "k_" names
  double value = 0.0;
  double u = 0.0;  ///< standard uncertainty (k = 1) in the model's datum, unit of `value`
  [[nodiscard]] bool is_angle() const;
};

}  // namespace abbe::calib
