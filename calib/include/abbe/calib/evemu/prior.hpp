#pragma once
/// What is believed of the coefficients before measuring, with a few numbers left to the data
/// (maximum marginal likelihood). On the scaled design, where every coefficient is the size of its
/// contribution:
///   constants: 5 mm;
///   bayes-pose: linear translations max(s_d, 2 mm), since squareness knows no smallness; but along the
///     axis itself, where they are a scale, max(s_d, 100 um/m arm) half width / arm (arm: the largest half
///     width), and s_a for rotations at an unknown offset: of a flat array nothing else limits the scale
///     of the axis across it; order k translations s_d rho^(k-1); rotations s_a rho^(k-1) times arm; random
///     pose rotations of w;
///   ridge: everything but the constants t, no pose rotations.

#include <Eigen/Core>
#include <span>

#include "abbe/calib/evemu/linear_gaussian.hpp"
#include "abbe/calib/evemu/scaled_design.hpp"

namespace abbe::calib::evemu {

inline constexpr double kConstantPrior_m = 5e-3;
inline constexpr double kLinearPrior_m = 2e-3;
inline constexpr double kScalePrior = 100e-6;  ///< half of GateLimits::max_scale_error

enum class PriorKind { Ridge, BayesPose };

struct HyperParameters {
  double s_d_m = 1e-3;    ///< translations; for ridge: of everything
  double rho = 0.5;       ///< decay per order
  double s_a_m = 0.5e-3;  ///< rotations at the largest half width
  double s_m = 5e-6;      ///< noise of a ball centre, per coordinate
  double w_rad = 1e-4;    ///< pose rotations, per axis
  double log_likelihood = 0.0;
  int evaluations = 0;
};

/// Prior variances of the design's coefficients, then of 3 rotations per position [m^2, rad^2].
[[nodiscard]] Eigen::VectorXd prior_variances(PriorKind, const ScaledDesign&, std::size_t positions,
                                              const HyperParameters&);

/// Quasi-Newton from a few starts within fixed bounds (s 1 nm to 1 mm, w 0.01 urad to 10 mrad,
/// ...). Deterministic. `problem`: whitened rows of design and pose rotations, and between them
/// those of columns with known prior variances `added`. NotConverged where no start has a
/// likelihood.
[[nodiscard]] Result<HyperParameters> most_likely(PriorKind, const ScaledDesign&,
                                                  std::size_t positions,
                                                  const LinearGaussian& problem,
                                                  std::span<const double> added = {});
/// prior_variances() with those of added columns between design and rotations.
[[nodiscard]] Eigen::VectorXd with_added(const Eigen::VectorXd& variances, std::size_t design_size,
                                         std::span<const double> added);

}  // namespace abbe::calib::evemu
