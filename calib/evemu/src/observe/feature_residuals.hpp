#pragma once
/// Residuals of the touches of a ball array to the fitted surfaces of its balls and faces.

#include <Eigen/Core>
#include <cstddef>
#include <string>
#include <vector>

#include "abbe/calib/evemu/observe/observe.hpp"
#include "abbe/calib/model/volumetric_model.hpp"

namespace abbe::calib::evemu {

/// Residuals of the touches of one ball or face to its fitted surface, after the V of a model is
/// removed.
struct FeatureResiduals {
  std::size_t seen = 0;
  Feature feature = Feature::Ball;
  std::size_t index = 0;  ///< index of the ball or block, from 0
  std::vector<Vector3> points_m;
  Vector3 centre_m = Vector3::Zero();  ///< centre of a ball
  double radius_m = 0.0;               ///< radius of a ball plus radius of the tip
  Eigen::MatrixXd normals;             ///< outward normal at each touch, 3 columns
  /// Matrix (unknowns x touches): effect of a touch's displacement along its normal on the unknowns
  /// of the surface.
  Eigen::MatrixXd response;
  Eigen::VectorXd r_m;   ///< residual of each touch, along the normal
  Eigen::VectorXd free;  ///< 1 - leverage: share of a touch's displacement that appears in its
                         ///< residual
  [[nodiscard]] double dof() const { return static_cast<double>(r_m.size() - response.rows()); }
};

struct Features {
  std::vector<FeatureResiduals> compared;
  std::vector<std::string> failed;  ///< places of features without finite residuals
};

/// Residuals of all features with more touches than unknowns.
[[nodiscard]] Features all_features(const Observations&, const VolumetricModel&);

/// Touches with a smaller free share are not used: a touch that alone determines a part of its
/// surface has no residual.
inline constexpr double kLeastFree = 0.05;

/// Standard deviation of one touch: median of |residual| / sqrt(free share), times 1.4826 for
/// normal noise.
[[nodiscard]] double pooled_sigma_m(const std::vector<FeatureResiduals>&);

/// Standard deviation of a ball centre per coordinate that follows from the standard deviation of a
/// touch, rms over the balls.
[[nodiscard]] double centre_noise_m(const std::vector<FeatureResiduals>&, double sigma_m);

/// Text such as "position 3, ball 4".
[[nodiscard]] std::string place_of(const Observations&, const FeatureResiduals&);

/// Effect on the observed errors of a displacement of the touches along their normals.
[[nodiscard]] Eigen::VectorXd effect_m(const Observations&, const FeatureResiduals&,
                                       const Eigen::VectorXd& along_m);

}  // namespace abbe::calib::evemu
