#pragma once
/// The plan of a calibration with a Multi-Feature Bar, and its touches. One measurement is one pass
/// along the bar in one position with one tool. Lengths in m, machine axes.
///
/// reading: scale readings of X, Y, Z; t: tool offset, tool reference point to the centre of the
/// tip; -J of [Viprey 2016]. The centre of the tip is at reading + t.

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/geometry/axis_interpolation.hpp"
#include "abbe/calib/geometry/axis_table.hpp"
#include "abbe/calib/mfb/run/bar.hpp"

namespace abbe::calib::mfb {

/// Forward: from O_1 to O_N. A backward pass after a forward one of the same position and tool is
/// its pair; for a pair, identification estimates a drift that is linear in time.
enum class PassDirection { Forward, Backward };

struct Measurement {
  std::string name;      ///< unique name
  std::string position;  ///< label of the clamping of the bar; measurements of one clamping have
                         ///< the same label
  Vector3 origin_m = Vector3::Zero();  ///< planned place of the tip's centre when the tip is at O_1
  Vector3 bar_x = Vector3::UnitX();    ///< planned bar axes in machine axes, of any length
  Vector3 bar_z = Vector3::UnitZ();
  Vector3 tool_offset_m = Vector3::Zero();
  PassDirection direction = PassDirection::Forward;
  std::optional<double> temperature_K;  ///< temperature of the bar; required if the bar states its
                                        ///< expansion

  /// Planned bar axes as columns x, y, z; orthonormal if bar_x and bar_z are perpendicular.
  [[nodiscard]] Matrix3 axes() const;
};

/// Largest permitted difference of the bar temperature from 20 C; a larger one must be accepted by
/// name (bar-temperature). It is then probably in degrees Fahrenheit or a typing error. Residuals
/// do not reveal a wrong temperature.
inline constexpr double kMostFromReference_K = 12.0;
/// Largest permitted difference of the bar temperature at a position from both positions next to it
/// in time, plus three times the uncertainty of the temperature. A larger one must be accepted by
/// name (bar-temperature-change).
inline constexpr double kMostBetweenPositions_K = 1.0;

/// Standard uncertainties (k = 1).
struct TouchNoise {
  double probe_m = 0.0;          ///< of one touch of the probe, along the surface normal
  double machine_m = 0.0;        ///< of one touch, in each machine axis (repeatability)
  double u_temperature_K = 0.0;  ///< of temperature_K; one error per position
  /// Standard uncertainty of the error of temperature_K that is common to all positions: that of
  /// the thermometer. It changes all lengths by the same factor. If it is not stated,
  /// u_temperature_K is used.
  std::optional<double> u_common_temperature_K{};

  [[nodiscard]] double common_temperature_K() const {
    return u_common_temperature_K.value_or(u_temperature_K);
  }
};

struct Plan {
  std::vector<Measurement> measurements;  ///< in the order of time
  double tip_radius_m = 0.0;
  TouchNoise noise;
  Vector3 gravity = -Vector3::UnitZ();  ///< direction of gravity in machine axes
};

/// The machine whose errors are identified.
struct MfbMachine {
  KinematicChain chain;
  MachineNodes nodes;  ///< nodes of the tables of X, Y, Z; at least 4 per axis for a cubic
  Interpolation interpolation = Interpolation::NotAKnotCubic;
};

/// Checks a plan. BadInput: no measurement, a name that is empty or repeated, axes that are zero or
/// more than 1 mrad from perpendicular, a position with two poses, a tool offset or radius of the
/// tip that is not possible, a noise that is not positive, a temperature missing where the bar
/// states its expansion. NotFinite for NaN. The text names the measurement.
[[nodiscard]] Result<void> check(const Plan&, const Bar&);

/// One touch of a pass.
struct Touch {
  Target target;
  Vector3 reading_m = Vector3::Zero();  ///< raw scale readings without any compensation
  bool set_aside = false;               ///< true: not used, but it keeps its place in the time of
                                        ///< the pass
};

/// The touches of one measurement in the order of probing, at a constant rate: time = index /
/// (number of touches - 1), 0 to 1 in a forward pass, 1 to 2 in its backward pair. Touches may be
/// missing as long as their feature remains determined (hole, rod: kFewestOfCylinder; plane:
/// kFewestOfPlane).
using PassTouches = std::vector<Touch>;
inline constexpr std::size_t kFewestOfCylinder = 6;
inline constexpr std::size_t kFewestOfPlane = 3;

/// For each measurement: the index of the forward pass of which it is the backward pair; nullopt:
/// it is not the backward pass of a pair.
[[nodiscard]] std::vector<std::optional<std::size_t>> pairs_of(std::span<const Measurement>);

}  // namespace abbe::calib::mfb
