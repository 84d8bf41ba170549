#pragma once
/// Residuals of the touches to the features of their pass, after the identified errors of the
/// machine are taken out (identify.hpp).

#include <vector>

#include "abbe/calib/mfb/solve/identify.hpp"

namespace abbe::calib::mfb {

struct ResidualsOfFeature {
  std::size_t measurement = 0;
  Target feature;                    ///< k is not used
  std::vector<std::size_t> k;        ///< of each used touch
  std::vector<Vector3> corrected_m;  ///< centre of the tip without errors of the machine
  std::vector<double> residual_m;    ///< along the outward normal
  std::size_t degrees_of_freedom = 0;

  /// Root of the sum of squares per degree of freedom; 0 without redundancy.
  [[nodiscard]] double sigma_m() const;
};

/// `U`: parameters of the model.
[[nodiscard]] std::vector<ResidualsOfFeature> feature_residuals(const Observations&,
                                                                std::span<const PassTouches>,
                                                                const Eigen::VectorXd& U);

/// The same feature without one of its touches: `place` in k. nullopt if the rest does not
/// determine it. `off_m`: distance of the touch that was left out.
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
