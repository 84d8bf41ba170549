#pragma once
/// A part of a joint identification is the information of one method (or one of its runs) about the
/// tables of a machine. Every part is an Information about the same unknowns,
/// 1. the parameters U of the common tables in datum G2 (the conditions of the datum are exact),
/// 2. effects: errors of instruments, artefacts and scales, each with the prior N(0, 1). Effects
/// with the same name are the same error in several parts.
/// Nuisances of one part (pose of the tracker, poses of the array) are already eliminated.
///
/// Tools. The 14 tables of one target include the effect of its tool offset t on the rotations that
/// they leave out (parameter_layout.hpp): of the axis nearest to the tool, and of the middle axis
/// about its direction. A part with another tool t + d sees in addition
///     phi_a(q_a) x d      for every rotation phi_a that was left out.
/// These rotations are nuisances of the part, one table each, without prior. The part then has less
/// information about the translations of these axes, and the same information about all other
/// tables.
///
/// All functions are pure and may be called from any thread. The text of an error starts with
/// "joint identification: " and names the part.

#include <Eigen/Core>
#include <array>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "abbe/calib/estimation/information.hpp"
#include "abbe/calib/evemu/observe/observe.hpp"
#include "abbe/calib/geometry/table_basis.hpp"
#include "abbe/calib/mfb/observe/observe.hpp"
#include "abbe/calib/model/offset_in_model.hpp"
#include "abbe/calib/model/volumetric_model.hpp"
#include "abbe/calib/otf/solve/solve.hpp"

namespace abbe::calib::joint {

/// The tables that all parts describe, and the tool for which they hold.
struct CommonTables {
  TableBasis basis;
  Vector3 tool_offset_m = Vector3::Zero();
};
/// Returns the tables of a model. NotApplicable unless it has tables in datum G2 for one tool,
/// without dependence on the direction of travel.
[[nodiscard]] Result<CommonTables> tables_of(const VolumetricModel&);

/// The same observations under the hypothesis that the part contains a mistake.
struct Mistake {
  std::string text;  ///< such as "the errors have X and Y swapped"
  estimation::Information information;
  /// Information without the mistake, in the same form and with the same noise, so that the fits of
  /// both can be compared.
  estimation::Information as_given;
};

struct Part {
  std::string name;    ///< name for messages, such as "run 1"
  std::string method;  ///< one of "otf", "evemu", "mfb"
  /// about the parameters of the common tables, then `effects`; the priors of the effects are not
  /// included
  estimation::Information information;
  std::vector<std::string> effects{};
  /// Standard uncertainty of each effect in its own unit (relative, m, rad). Parts that share an
  /// effect must state the same value, because the unknown is a multiple of it. Empty: these values
  /// are not compared.
  std::vector<double> u_of_effects{};
  /// Degrees of freedom of the noise variance if it was estimated from residuals of the part; the
  /// covariance of the part was multiplied by this variance. 0: the uncertainties were stated.
  double dof_of_noise = 0.0;
  std::vector<Vector3> covered_m{};  ///< axis positions; their hull is the validity volume
  std::optional<Misfit> misfit{};    ///< misfit of the model of a run; the joint model has the
                                     ///< largest misfit of all parts
  /// Hypotheses about mistakes of the method; called only if the part contradicts another one. May
  /// be empty.
  std::function<std::vector<Mistake>()> mistakes{};
};

/// Standard uncertainties of errors that several parts have in common. An error that is not stated
/// here counts as independent between the parts. If it is in fact common to n parts, the joint
/// uncertainty is too small by up to sqrt(n).
struct CommonEffects {
  /// Relative standard uncertainty of the scale of the ranges (otf::Noise::u_scale). Parts with the
  /// same `ranges_of` were measured with the same tracker.
  double u_ranges = 0.0;
  std::string ranges_of = "tracker";
  /// Relative standard uncertainty of the length of the scales of X, Y, Z
  /// (otf::Noise::u_axis_scale): the same error in all parts.
  std::array<double, 3> u_axis_scale{};
  /// For a run: the place of its tracker, with the range offset that the run estimated
  /// (otf::Solution::offset_in_model). Runs with the same place name have one offset: the same
  /// tracker with the same reflector, and no new home position or initialisation between them. The
  /// part contains the information of its data alone about the offset; the prior is used once for
  /// all runs. nullopt: the run has an offset of its own.
  std::optional<TrackerPlace> place{};
};

/// Makes the part of an on-the-fly run from its model and covariance, which contains all effects of
/// the run. `effects` are those that other parts share: they are separated from the covariance and
/// become unknowns of the part. NotApplicable for other nodes, tables or axes than the common ones,
/// or another datum; and if the covariance is not larger than the effects, or leaves a combination
/// without uncertainty.
[[nodiscard]] Result<Part> part_of_run(std::string name, const VolumetricModel&,
                                       const CommonTables&, const CommonEffects& = {});

struct ArrayOptions {
  /// Standard deviation of a ball centre per coordinate. 0: estimated from the residuals of the
  /// part alone, with the tables and the errors of the array free.
  double s_m = 0.0;
  /// Largest accepted estimate of s_m. Centres of balls touched at five points scatter by 1 to 8
  /// um; a larger scatter is an error of the array, its files or the machine that the tables do not
  /// contain.
  double most_s_m = 10e-6;
  /// Name of the array. Parts with the same name used the same array, with the same calibration
  /// errors.
  std::string array = "array";
  CommonEffects effects{};  ///< effects of the scales; an array has no ranges
  /// Parameters of the common tables at which the poses are computed; empty: zero.
  Eigen::VectorXd linearised_at{};
};
/// Makes the part of a ball array (evemu/solve/pose_groups.hpp). NotApplicable for another order of
/// the axes. TooFewObservations without ball errors, or if s is to be estimated from fewer than 20
/// degrees of freedom. BadInput for a ball beyond the nodes of the common tables (they are not
/// extrapolated), or if s is larger than `most_s_m`; the text then names mistakes whose correction
/// makes s small enough.
[[nodiscard]] Result<Part> part_of_array(std::string name, const evemu::Observations&,
                                         const CommonTables&, const ArrayOptions& = {});

struct BarOptions {
  /// Name of the bar. Parts with the same name used the same bar, with the same calibration errors.
  std::string bar = "bar";
  CommonEffects effects{};  ///< effects of the scales; a bar has no ranges
  /// Standard uncertainty of the roll of the bar (mfb::SolveOptions).
  double u_roll_rad = 100e-6;
};
/// The machine with which mfb::observe() makes observations for part_of_bar(): all 18 tables on the
/// nodes of the common ones.
[[nodiscard]] mfb::MfbMachine bar_machine(const CommonTables&);
/// Makes the part of a Multi-Feature Bar from the rows of all positions (mfb/observe/observe.hpp),
/// with the weights that the plan states; their nuisances are eliminated. A bar touched with
/// several tools determines all 18 tables. With the tool t of the common tables and the rotations
/// phi that they leave out
///     V(q, t + d) = V(q, t + d; common tables) + phi(q) x d
/// holds exactly, so that phi is a nuisance of the part, one table each, without prior. Effects:
/// errors of the calibration of the bar, of its expansion and of its thermometer. NotApplicable for
/// observations on other axes or nodes; errors of the adjustment of the bar.
[[nodiscard]] Result<Part> part_of_bar(std::string name, const mfb::Observations&,
                                       const CommonTables&, const BarOptions& = {});

}  // namespace abbe::calib::joint
