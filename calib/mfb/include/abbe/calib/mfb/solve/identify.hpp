#pragma once
/// Identification of the 21 ISO 230-1 errors of three linear axes with a Multi-Feature Bar:
/// observe(), solve(), and the judgement of the residuals. Touches far from their feature are set
/// aside: touches are corrected by the identified errors of the machine, and a feature whose
/// residuals exceed SetAsideOptions::limit times the noise of a touch is searched; of its touches
/// the one is excluded without which chi-square is smallest, because opposite touches of a hole
/// have the same residuals. Raw residuals would not do: a good hole on a diagonal shows the shear
/// of the machine.

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
  /// More touches than this share of a pass are not single outliers: the rest is left in.
  double most_of_pass = 0.02;
  /// The same for all passes together.
  double most_of_all = 0.01;
};

struct Options {
  SolveOptions solve;
  ObserveLimits limits;
  SetAsideOptions outliers;
};

struct SetAsideTouch {
  std::size_t measurement = 0;  ///< in the plan
  std::string measurement_name;
  Target target;
  double residual_m = 0.0;  ///< along the normal, from the feature without this touch
};

/// Distance of a touch from the least-squares feature of its pass, along the outward normal, after
/// the errors of the machine were taken out.
struct TouchResidual {
  std::size_t measurement = 0;  ///< in the plan
  Target target;
  double residual_m = 0.0;
  bool set_aside = false;  ///< then the feature is that without this touch
};

enum class Cause { None, Drift, Hole, Measurement, Unknown };
/// "none", "drift", "hole", "measurement", "unknown": for files.
[[nodiscard]] std::string_view name(Cause);

/// Why chi-square is too large: the alternative that explains it best.
struct LikelyCause {
  Cause cause = Cause::None;
  std::string text;                   ///< one sentence with numbers and what to do; empty for None
  double chi2_per_dof_without = 0.0;  ///< with the alternative
};

struct Identification {
  Observations observations;
  Solution solution;
  /// 18 tables and squareness, datum G2, tool offsets of the plan. Its validity volume is the box
  /// of the touched readings inside the nodes: every error is determined at every node.
  VolumetricModel model;
  std::vector<SetAsideTouch> set_aside;
  /// Features whose touches do not fit together, but too many are wrong or missing to find out
  /// which: "X2: hole 3". Their touches are used.
  std::vector<std::string> unresolved_features;
  std::vector<TouchResidual> touch_residuals;
  double u_touch_m = 0.0;  ///< standard uncertainty of a touch along the normal
  LikelyCause cause;
  std::vector<std::string> notes;  ///< further sentences for the report
};

/// The errors of observe() and solve(). Pure and deterministic: the same input gives the same bits.
[[nodiscard]] Result<Identification> identify(const Bar&, const Plan&, std::span<const PassTouches>,
                                              const MfbMachine&, const Options& = {});

}  // namespace abbe::calib::mfb
