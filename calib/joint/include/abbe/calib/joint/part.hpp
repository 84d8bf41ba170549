#pragma once
/// Parts of a joint identification: what one method (or one run of it) states about the tables of a
/// machine. Every part is an Information about the same unknowns,
/// 1. the parameters U of the common tables in datum G2 (the conditions of the datum are exact),
/// 2. effects: errors of instruments, artefacts and scales, each with the prior N(0, 1). Effects of
///    the same name are the same error in several parts.
/// Nuisances of one part (pose of the tracker, poses of the array) are already eliminated.
///
/// Tools. The 14 tables of one target include the effect of its tool offset t on the rotations that
/// they leave out (parameter_layout.hpp): of the axis nearest to the tool, and of the middle axis
/// about its direction. A part with another tool t + d sees in addition
///     phi_a(q_a) x d      for every rotation phi_a that was left out.
/// These rotations are nuisances of the part, one table each, without prior: the part then states
/// less about the translations of these axes, and as much about everything else.
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
/// The tables of a model. NotApplicable unless it has tables in datum G2 for one tool, without
/// dependence on the direction of travel.
[[nodiscard]] Result<CommonTables> tables_of(const VolumetricModel&);

/// The same observations under the hypothesis of a mistake in the part.
struct Mistake {
  std::string text;  ///< "the errors have X and Y swapped"
  estimation::Information information;
  /// Without the mistake, in the same form and with the same noise: the fit of both is comparable.
  estimation::Information as_given;
};

struct Part {
  std::string name;    ///< for messages: "run 1"
  std::string method;  ///< "otf", "evemu", "mfb"
  /// about the parameters of the common tables, then `effects`; without the priors of the effects
  estimation::Information information;
  std::vector<std::string> effects{};
  /// Standard uncertainty of each effect in its own unit (relative, m, rad); empty: not compared.
  /// Parts that share an effect must state the same one, since the unknown is a multiple of it.
  std::vector<double> u_of_effects{};
  /// The covariance of the part was multiplied by a variance estimated from its own residuals with
  /// these degrees of freedom; 0: the uncertainties were stated.
  double dof_of_noise = 0.0;
  std::vector<Vector3> covered_m{};  ///< axis positions; their hull is the validity volume
  std::optional<Misfit> misfit{};    ///< of the model of a run; the joint model has the largest
  /// Mistakes of the method; called only if the part contradicts another one. May be empty.
  std::function<std::vector<Mistake>()> mistakes{};
};

/// Standard uncertainties of errors that parts have in common. An error that is not stated here
/// counts as independent between the parts: if it is not, the joint uncertainty of n parts is too
/// small by up to sqrt(n).
struct CommonEffects {
  /// Relative, of the scale of the ranges (otf::Noise::u_scale). Parts with the same `ranges_of`
  /// had the same tracker.
  double u_ranges = 0.0;
  std::string ranges_of = "tracker";
  /// Relative, of the length of the scales of X, Y, Z (otf::Noise::u_axis_scale): the same in all
  /// parts.
  std::array<double, 3> u_axis_scale{};
  /// Of a run: where its tracker stood, with the offset as the run estimated it
  /// (otf::Solution::offset_in_model). Runs of one name have one offset: the same tracker with the
  /// same reflector, and no new home position or initialisation between them. The part states what
  /// its data alone know about the offset, and the prior is counted once for all runs. nullopt: the
  /// run has an offset of its own.
  std::optional<TrackerPlace> place{};
};

/// The part of an on-the-fly run: its model with its covariance, which contains all effects of the
/// run. `effects` are those that the covariance contains and that other parts share: they are
/// separated from the covariance and become unknowns of the part.
/// NotApplicable for other nodes, tables or axes than the common ones, or another datum; and if the
/// covariance is not larger than the effects, or leaves a combination without uncertainty.
[[nodiscard]] Result<Part> part_of_run(std::string name, const VolumetricModel&,
                                       const CommonTables&, const CommonEffects& = {});

struct ArrayOptions {
  /// Standard deviation of a ball centre per coordinate. 0: estimated from the residuals of the
  /// part alone, with the tables and the errors of the array free.
  double s_m = 0.0;
  /// Largest estimated s. Centres of balls touched at five points scatter by 1 to 8 um; a larger
  /// scatter is an error of the array, its files or the machine that the tables do not contain.
  double most_s_m = 10e-6;
  /// Parts with the same name had the same array, with the same errors of its calibration.
  std::string array = "array";
  CommonEffects effects{};  ///< of the scales; an array has no ranges
  /// Parameters of the common tables at which the poses are computed; empty: zero.
  Eigen::VectorXd linearised_at{};
};
/// The part of a ball array (evemu/solve/pose_groups.hpp). NotApplicable for another order of the
/// axes. TooFewObservations without ball errors, or if s is to be estimated from fewer than 20
/// degrees of freedom; BadInput for a ball beyond the nodes of the common tables (they are not
/// extrapolated), or if s is larger than `most_s_m`, naming the mistakes without which it is not.
[[nodiscard]] Result<Part> part_of_array(std::string name, const evemu::Observations&,
                                         const CommonTables&, const ArrayOptions& = {});

struct BarOptions {
  /// Parts with the same name had the same bar, with the same errors of its calibration.
  std::string bar = "bar";
  CommonEffects effects{};  ///< of the scales; a bar has no ranges
  /// Standard uncertainty of the roll of the bar (mfb::SolveOptions).
  double u_roll_rad = 100e-6;
};
/// The machine with which mfb::observe() makes observations for part_of_bar(): all 18 tables on the
/// nodes of the common ones.
[[nodiscard]] mfb::MfbMachine bar_machine(const CommonTables&);
/// The part of a Multi-Feature Bar: the rows of all positions (mfb/observe/observe.hpp), their
/// nuisances eliminated, with the weights that the plan states. A bar touched with several tools
/// sees all 18 tables. With the tool t of the common tables and the rotations phi that they leave
/// out
///     V(q, t + d) = V(q, t + d; common tables) + phi(q) x d
/// holds exactly, so that phi is a nuisance of the part, one table each, without prior. Effects:
/// errors of the calibration of the bar, of its expansion and of its thermometer. NotApplicable for
/// observations on other axes or nodes; errors of the adjustment of the bar.
[[nodiscard]] Result<Part> part_of_bar(std::string name, const mfb::Observations&,
                                       const CommonTables&, const BarOptions& = {});

}  // namespace abbe::calib::joint
