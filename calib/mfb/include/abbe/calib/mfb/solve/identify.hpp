#pragma once
/// Identification of the 21 ISO 230-1 errors of three linear axes with a Multi-Feature Bar:
/// observe(), solve(), and the search for wrong touches. The touches are first corrected by the
/// identified errors of the machine. (Without this correction a good hole on a diagonal would have
/// large residuals, because the machine's shear deforms it.) A feature is searched if its residuals
/// exceed SetAsideOptions::limit times the noise of a touch. Opposite touches of a hole have the
/// same residuals. The touch that is set aside (excluded) is therefore the one without which
/// chi-square is smallest.

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/calib/mfb/solve/solve.hpp"
#include "abbe/calib/model/volumetric_model.hpp"

namespace abbe::calib::mfb {

struct SetAsideOptions {
  bool enabled = true;
  /// Residuals of a feature (root of the squares per degree of freedom) relative to the noise of a
  /// touch, or to the median of the features of its kind if that is larger (form errors).
  double limit = 5.0;
  /// Largest share of the touches of a pass that may be set aside. If more are wrong, they are not
  /// single outliers, and the others are used.
  double most_of_pass = 0.02;
  /// Largest share of the touches of all passes that may be set aside.
  double most_of_all = 0.01;
};

struct Options {
  SolveOptions solve;
  ObserveLimits limits;
  SetAsideOptions outliers;
};

struct SetAsideTouch {
  std::size_t measurement = 0;  ///< index in the plan
  std::string measurement_name;
  Target target;
  double residual_m = 0.0;  ///< along the normal, distance from the feature that is fitted without
                            ///< this touch
};

/// Distance of a touch from the least-squares feature of its pass, along the outward normal, after
/// the machine errors have been subtracted.
struct TouchResidual {
  std::size_t measurement = 0;  ///< index in the plan
  Target target;
  double residual_m = 0.0;
  bool set_aside = false;  ///< true: the feature was fitted without this touch
};

enum class Cause { None, Drift, Hole, Measurement, Unknown };
/// Name for files: "none", "drift", "hole", "measurement" or "unknown".
[[nodiscard]] std::string_view name(Cause);

/// The alternative that best explains a chi-square above its limit.
struct LikelyCause {
  Cause cause = Cause::None;
  std::string text;                   ///< one sentence with numbers and what to do; empty for None
  double chi2_per_dof_without = 0.0;  ///< chi-square per degree of freedom under this alternative
};

struct Identification {
  Observations observations;
  Solution solution;
  /// 18 tables and squareness, datum G2, tool offsets of the plan. Its validity volume is the box
  /// of the touched readings inside the nodes: every error is determined at every node.
  VolumetricModel model;
  std::vector<SetAsideTouch> set_aside;
  /// Features whose touches do not fit together, but too many are wrong or missing to find the
  /// wrong ones. Their touches are used. Such as "X2: hole 3".
  std::vector<std::string> unresolved_features;
  std::vector<TouchResidual> touch_residuals;
  double u_touch_m = 0.0;  ///< standard uncertainty of a touch along the normal
  LikelyCause cause;
  std::vector<std::string> notes;  ///< further sentences for the report
};

/// Identifies the errors. Returns the errors of observe() and solve(). Pure and deterministic: the
/// same input gives the same bits.
[[nodiscard]] Result<Identification> identify(const Bar&, const Plan&, std::span<const PassTouches>,
                                              const MfbMachine&, const Options& = {});

}  // namespace abbe::calib::mfb
