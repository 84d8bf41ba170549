#pragma once
/// Residuals of the touches of one feature in one pass, after the identified machine errors have
/// been subtracted (identify.hpp).

#include <vector>

#include "abbe/calib/mfb/solve/identify.hpp"

namespace abbe::calib::mfb {

struct ResidualsOfFeature {
  std::size_t measurement = 0;
  Target feature;                    ///< k is not used
  std::vector<std::size_t> k;        ///< number k of each used touch
  std::vector<Vector3> corrected_m;  ///< centre of the tip without the machine errors
  std::vector<double> residual_m;    ///< along the outward normal
  std::size_t degrees_of_freedom = 0;

  /// Root of the sum of squares per degree of freedom; 0 without redundancy.
  [[nodiscard]] double sigma_m() const;
};

/// Computes the residuals of all features. `U`: parameters of the model.
[[nodiscard]] std::vector<ResidualsOfFeature> feature_residuals(const Observations&,
                                                                std::span<const PassTouches>,
                                                                const Eigen::VectorXd& U);

/// Fit of a feature without one of its touches. `off_m`: distance of this touch from the fitted
/// feature.
struct WithoutTouch {
  double squares_m2 = 0.0;
  double off_m = 0.0;
};
[[nodiscard]] std::optional<WithoutTouch> without_touch(const ResidualsOfFeature&,
                                                        std::size_t place, const Matrix3& axes);
/// Approximate direction of the axis, or outward normal, of a feature, in machine axes. `axes`: x,
/// y and z of the bar as columns.
[[nodiscard]] Vector3 near_direction(const ResidualsOfFeature&, const Matrix3& axes);

}  // namespace abbe::calib::mfb
