#pragma once
/// Prior of the coefficients, with a few hyper-parameters that are estimated from the data (maximum
/// marginal likelihood). The prior applies to the scaled design (scaled_design.hpp), where every
/// coefficient is the size of its contribution to V. Prior standard deviations, with s_d, s_a, rho,
/// t and w of HyperParameters:
///   constants                5 mm
///   bayes-pose
///     linear translations    max(s_d, 2 mm), because squareness errors can be large
///     scale of an axis       root sum of squares of s_a and
///                            max(s_d, 100 um/m times arm) half width of the axis / arm
///     translations, order k  s_d rho^(k-1)
///     rotations, order k     s_a rho^(k-1), at the distance arm
///     pose rotations         w
///   ridge                    t for all coefficients except the constants; no pose rotations
/// arm: the largest half width of the box of readings. The scale of an axis is its linear
/// translation along itself. The part s_a of its prior stands for rotations at an unknown offset;
/// with a flat array only this prior limits the scale of the axis perpendicular to the array.

#include <Eigen/Core>
#include <span>
#include <vector>

#include "abbe/calib/evemu/solve/linear_gaussian.hpp"
#include "abbe/calib/geometry/scaled_design.hpp"

namespace abbe::calib::evemu {

inline constexpr double kConstantPrior_m = 5e-3;
inline constexpr double kLinearPrior_m = 2e-3;
inline constexpr double kScalePrior = 100e-6;  ///< half of GateLimits::max_scale_error

enum class PriorKind { Ridge, BayesPose };

struct HyperParameters {
  double s_d_m = 1e-3;    ///< translations; for ridge: t, of all coefficients except the constants
  double rho = 0.5;       ///< decay of the prior per order
  double s_a_m = 0.5e-3;  ///< standard deviation of rotations at the largest half width
  double s_m = 5e-6;      ///< noise of a ball centre, per coordinate
  double w_rad = 1e-4;    ///< standard deviation of pose rotations, per axis
  double log_likelihood = 0.0;
  int evaluations = 0;
};

/// Prior variances of the design's coefficients, then of 3 rotations per position [m^2, rad^2].
[[nodiscard]] Eigen::VectorXd prior_variances(PriorKind, const ScaledDesign&, std::size_t positions,
                                              const HyperParameters&);

/// Hyper-parameters of the largest marginal likelihood: quasi-Newton search from a few starting
/// points within fixed bounds (s 1 nm to 1 mm, w 0.01 urad to 10 mrad, and others). Deterministic.
/// The whitened columns of `problem` are those of the design, then columns whose prior variances
/// `added` are known, then those of the pose rotations. NotConverged if the likelihood cannot be
/// computed at any starting point.
[[nodiscard]] Result<HyperParameters> most_likely(PriorKind, const ScaledDesign&,
                                                  std::size_t positions,
                                                  const LinearGaussian& problem,
                                                  std::span<const double> added = {});
/// Natural logarithm of a likelihood ratio up to which the data hardly distinguish two sets of
/// hyper-parameters: about the 95 % interval of one parameter.
inline constexpr double kComparable = 2.0;

/// Hyper-parameters of the estimator bayes-pose that the data hardly distinguish from the most
/// likely ones: each of s_d, rho, s_a, w is changed in steps of a factor of 2 in both directions,
/// at most 8 times, and the others are estimated again, until the likelihood is lower by more than
/// e^kComparable.
[[nodiscard]] std::vector<HyperParameters> comparable_parameters(const HyperParameters& most_likely,
                                                                 const ScaledDesign&,
                                                                 std::size_t positions,
                                                                 const LinearGaussian& problem);

/// prior_variances() with the variances of added columns inserted between design and rotations.
[[nodiscard]] Eigen::VectorXd with_added(const Eigen::VectorXd& variances, std::size_t design_size,
                                         std::span<const double> added);

}  // namespace abbe::calib::evemu
