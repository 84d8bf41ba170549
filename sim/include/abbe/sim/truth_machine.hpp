#pragma once
/// The true machine: three linear axes with 21 known geometric errors, by exact homogeneous
/// transforms.
///
///   p(q) = T_1 T_2 T_3 t,   T_a(q) = Trans(q_a e'_a) Trans(EXa, EYa, EZa) Rz(ECa) Ry(EBa) Rx(EAa)
///
/// q = scale readings; the axes a are ordered from workpiece to tool; EXa to ECa = error motions of
/// axis a; t = target offset from the tool reference point; e'_a = direction of travel, tilted by
/// the squareness errors alone and normalised (~: before normalisation):
///
///   e'_X = (1, 0, 0),  e'_Y ~ (-C0Y, 1, 0),  e'_Z ~ (B0Z, -A0Z, 1)
///   V = actual - nominal = p(q) - (q + t)
///
/// All quantities are the motion of the tool relative to the workpiece, in machine coordinates, for
/// primed and unprimed axes alike. SI units. Names: ISO 230-1. Written independently of `calib`, so
/// that `calib` is not tested against itself. Pure functions; safe to call from any thread.

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

#include "abbe/sim/error.hpp"
#include "abbe/sim/error_function.hpp"

namespace abbe::sim {

enum class Axis : std::size_t { X = 0, Y = 1, Z = 2 };
inline constexpr std::array<Axis, 3> kAxes{Axis::X, Axis::Y, Axis::Z};
inline constexpr std::string_view kAxisLetters = "XYZ";
/// "X", "Y" or "Z"; nullopt for anything else.
[[nodiscard]] constexpr std::optional<Axis> axis_named(std::string_view name) {
  const std::size_t place = name.size() == 1 ? kAxisLetters.find(name[0]) : std::string_view::npos;
  if (place == std::string_view::npos) return std::nullopt;
  return kAxes[place];
}

/// The six error motions of one axis: translations along x, y, z, then rotations about x, y, z.
enum class Motion : std::size_t { EX = 0, EY = 1, EZ = 2, EA = 3, EB = 4, EC = 5 };
inline constexpr std::size_t kMotions = 6;
inline constexpr std::string_view kMotionLetters = "XYZABC";
[[nodiscard]] inline std::string motion_name(std::size_t motion, Axis axis) {
  return {'E', kMotionLetters[motion], kAxisLetters[static_cast<std::size_t>(axis)]};
}

struct AxisRange {
  double min_m = 0.0;
  double max_m = 0.0;
  double reference_m = 0.0;
};

struct AxisTruth {
  AxisRange range;
  std::array<ErrorFunction, kMotions> error;
  /// Backlash b, m or rad: the error is f + s b / 2, where s is the direction of the last motion
  /// (+1, -1; 0 before the first motion).
  std::array<double, kMotions> backlash{};
};

struct Squareness {
  double A0Z_rad = 0.0;
  double B0Z_rad = 0.0;
  double C0Y_rad = 0.0;
};

/// Thermal drift of the machine. At heat 1 (final temperature, see MachineCondition) axis a has
/// expanded by expansion_per_m[a] per metre, and its zero point is shifted by shift_m[a].
struct ThermalDrift {
  Eigen::Vector3d expansion_per_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d shift_m = Eigen::Vector3d::Zero();
  double time_constant_s = 3600.0;
  [[nodiscard]] double heat_after(double elapsed_s) const;  ///< 1 - exp(-t / tau), 0 before t = 0
};

struct TruthMachine {
  std::array<Axis, 3> order{Axis::X, Axis::Y, Axis::Z};  ///< axes from workpiece to tool
  std::array<AxisTruth, 3> axes;                         ///< indexed by Axis, not by order
  Squareness squareness;
  ThermalDrift thermal;
  /// Sag under a moving load, which no error motion of a single axis describes. The target is lower
  /// by (x and y in m)
  ///
  ///   sag_m exp(-((x - 0.25) / 0.15)^2) (0.5 + y)
  double sag_m = 0.0;
  Eigen::Vector3d target_offset_m = Eigen::Vector3d::Zero();

  [[nodiscard]] AxisTruth& axis(Axis a) { return axes[static_cast<std::size_t>(a)]; }
  [[nodiscard]] const AxisTruth& axis(Axis a) const { return axes[static_cast<std::size_t>(a)]; }
};

/// The state on which the error depends, in addition to the position.
struct MachineCondition {
  std::array<int, 3> direction{};  ///< sign of the last motion of each axis
  double heat = 0.0;               ///< heat from 0 (cold) to 1 (final temperature)
};

/// The true position of the target in machine coordinates at scale reading q.
[[nodiscard]] Eigen::Vector3d position_m(const TruthMachine& truth, const Eigen::Vector3d& q_m,
                                         const MachineCondition& condition = {});

/// The error V at scale reading q.
[[nodiscard]] Eigen::Vector3d error_m(const TruthMachine& truth, const Eigen::Vector3d& q_m,
                                      const MachineCondition& condition = {});

/// The order of X, Y and Z in a kinematic chain such as "[w X' b Y Z (C1) t]", from workpiece to
/// tool. Other elements of the chain have no influence on V.
[[nodiscard]] Result<std::array<Axis, 3>> parse_chain(std::string_view chain);

}  // namespace abbe::sim
