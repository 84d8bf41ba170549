#pragma once
/// Compares directly measured error motions with the tables of a model, table by table, as in
/// [Sanders 2023] section 2.3. Both are brought into the same convention first, by the same linear
/// operator P on their values at the same positions: those measured positions that are within the
/// nodes of the model (the common range).
/// - Positioning and rotations: zero at the reference position of the axis if it is in the common
///   range, else at the smallest common position.
/// - Straightness: the line through the first and the last common position removed (section 2.3.2),
///   or the least-squares line.
/// - Squareness: the model's value from the slopes of its V along the two measured lines, which
///   meet at MeasuredError::line_m:
///       C0Y: -V_x / y - V_y / x,   B0Z: V_x / z + V_z / x,   A0Z: -V_y / z - V_z / y
///   over the common positions of the straightness errors, or the nodes of the model if these were
///   not measured. This value contains the effect of the rotations at line_m, for example of ECX(x)
///   in C0Y. A squareness without line_m is therefore not compared. A measured squareness has the
///   sign convention of the model: it is a rotation of the direction of travel.
///
/// The difference d = P (measured - model) at a position has the standard uncertainty u,
///     u^2 = u_runs^2 + u_device^2 + u_model^2
/// u_runs: scatter of the runs; u_device: DeviceUncertainty; u_model: from the covariance of the
/// model, P B C B^T P^T. The scatter is pooled over the m positions of a table. With n runs, c
/// conditions of the convention (2 for straightness, else 1) and rho, the correlation of
/// neighbouring positions,
///     s^2 = sum |r|^2 / ((n - 1)(m - c)),   u_runs^2 = s^2 / n diag(P P^T)
///     nu = (n - 1)(m - c) (1 - rho^2) / (1 + rho^2),   at least n - 1 degrees of freedom
/// r: deviation of a run from the mean of the runs after the least-squares removal of what the
/// convention removes. A position whose own scatter is larger than s uses its own scatter ([GUM]
/// 4.2.3).
/// A difference contradicts if it exceeds
///     limit = sqrt((t_nu u_runs)^2 + z^2 (u_device^2 + u_model^2))
/// t_nu, z: quantiles of Student's and of the normal distribution at the probability of one test.
/// Chance exceeds this limit with at most this probability, whatever the ratio of its terms,
/// because the distribution function of chi-square with 1 degree of freedom is concave. A limit
/// with the effective degrees of freedom of [GUM] G.4.1 would be exceeded more often: in cases
/// where s is estimated too small by chance.
///
/// u does not contain the following effects, so that each of them can cause a contradiction: errors
/// of the machine between the nodes of the model, thermal changes between the two measurements,
/// levers of the measured line that are not stated (MeasuredError::line_m). Where the convention
/// sets both values to zero, there is no difference to test. The model states errors without
/// backlash. The measured values are means of both directions, thus also without backlash, if both
/// directions were measured. Lengths in m, angles in rad. Pure.

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/calib/direct/runs.hpp"
#include "abbe/calib/model/volumetric_model.hpp"

namespace abbe::calib::direct {

enum class StraightnessLine { EndPoints, LeastSquares };

/// Standard uncertainty (k = 1) of the device, in addition to the scatter of the runs: resolution,
/// optics, air. Default 0: only the scatter of the runs is known.
struct DeviceUncertainty {
  double u_m = 0.0;    ///< of one translation value; values at different positions are independent
  double u_rad = 0.0;  ///< of one rotation value, or of a squareness
  double u_scale =
      0.0;  ///< relative, common to all lengths of a positioning error (wavelength, expansion)
};

struct CompareOptions {
  StraightnessLine line = StraightnessLine::EndPoints;
  DeviceUncertainty device{};
  /// Probability that at least one table is found to contradict although the model is correct in
  /// all of them. One test has this probability divided by the number of tests of all tables
  /// (Bonferroni).
  double false_alarm = 0.05;
};

enum class Finding {
  Agrees,       ///< no difference exceeds its limit
  Contradicts,  ///< at least one difference exceeds its limit
  /// No uncertainty is known, or no value of the model exceeds its limit. In the second case the
  /// measurement cannot distinguish the model from a machine without errors.
  NotTested,
  NotCompared,  ///< see TableComparison::reason
};
/// The text of a finding: "agrees", "contradicts", "not tested" or "not compared".
[[nodiscard]] std::string_view name(Finding);

/// Comparison at one position. Measured and model values are those after the operator P, in m or
/// rad.
struct PointDifference {
  double position_m = 0.0;
  double measured = 0.0, u_measured = 0.0;  ///< u_measured: from the scatter of the runs and the
                                            ///< device
  double model = 0.0, u_model = 0.0;
  double difference = 0.0, u = 0.0;
  double u_runs = 0.0;  ///< part of u from the scatter of the runs
  double limit = 0.0;   ///< a |difference| above it contradicts; 0 if not tested
  bool tested = false;
};

struct TableComparison {
  std::string name;
  bool is_angle = false;
  bool is_squareness = false;
  Finding finding = Finding::NotCompared;
  std::string reason;  ///< why the table is not compared or not tested; else empty
  /// Corrections of the measured values that bring them closer to the model. A text begins with
  /// "fits" if no corrected value exceeds its limit, else with "closer": the rms difference is then
  /// a third or less. The comparison cannot tell which of them is the true cause.
  std::vector<std::string> causes;
  std::size_t runs = 0;
  std::size_t dof = 0;       ///< degrees of freedom of the scatter of the runs
  std::size_t left_out = 0;  ///< number of positions that are missing in some run or direction
  std::size_t outside = 0;   ///< number of measured positions outside the nodes of the model
  std::string convention;    ///< such as "zero at 0 mm", "line through -300 and 300 mm removed"
  std::vector<PointDifference> points;
  double mae = 0.0, rms = 0.0, largest = 0.0;  ///< mean, rms and maximum of |difference|; m or rad
  double largest_at_m = 0.0;
  /// The largest limit of all positions: a |difference| above it contradicts at every position. 0
  /// if not tested.
  double revealed = 0.0;
  /// rms and maximum of |difference| / u over the tested points
  double rms_normalised = 0.0, largest_normalised = 0.0;
  std::optional<Reversal> reversal{};
};

/// Returns one entry per measured error, in the same order. NotApplicable: the model has no tables
/// (polynomials). BadInput: an unknown or repeated name, a false_alarm outside (0, 1), a negative
/// uncertainty. Also returns the errors of runs_of().
[[nodiscard]] Result<std::vector<TableComparison>> compare(std::span<const MeasuredError>,
                                                           const VolumetricModel&,
                                                           const CompareOptions& = {});

}  // namespace abbe::calib::direct
