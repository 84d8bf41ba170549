#pragma once
/// Qualification of a touch probe on a sphere of known radius R: its effective tip radius, and the
/// variation of that radius with the direction of approach (lobing, pre-travel variation). For a
/// touch from the outward direction n the scales give the centre p of the tip at
///     |p_i - c| = R + r + sum_j a_j Y_j(n_i)
/// c: centre of the sphere; r: effective tip radius. Y_j: the harmonic polynomials of degree 2 and
/// 3 in n (degree 0 is r, degree 1 would be c; the three lobes of a kinematic seat are of degree
/// 3). Gauss-Newton; residuals along n, independent, with one common standard deviation. Valid for
/// the stylus and the measuring speed of the qualification. Pure; allocates. SI units.

#include <Eigen/Core>
#include <span>

#include "abbe/calib/base/error.hpp"
#include "abbe/calib/geometry/rigid_transform.hpp"

namespace abbe::calib::probe {

struct QualifyingTouch {
  Vector3 p_m = Vector3::Zero();  ///< centre of the tip by the scales, with the delay compensated
  /// outward at the sphere, opposite to the approach; an accuracy of about 0.1 is enough
  Vector3 normal = Vector3::UnitZ();
};

struct QualificationOptions {
  double sphere_radius_m = 12.5e-3;  ///< certified radius
  double u_sphere_radius_m = 0.0;
  /// Limit for the condition number of the Jacobian with columns of unit length. Above this limit
  /// the touches cover too little of the sphere to distinguish lobing from the centre. Condition
  /// numbers for touches evenly distributed from the pole to a latitude: to the equator 74, to 0.3
  /// rad below the equator 18, to 0.3 rad above it 369.
  double max_condition = 300.0;
};

/// Effective tip radius for one outward direction n, to be subtracted along n, and its standard
/// uncertainty.
struct EffectiveRadius {
  double radius_m = 0.0;
  double u_m = 0.0;
};

class LobingMap {
 public:
  static constexpr int kTerms = 13;  ///< r, five of degree 2, seven of degree 3
  using Terms = Eigen::Matrix<double, kTerms, 1>;
  using Covariance = Eigen::Matrix<double, kTerms, kTerms>;

  LobingMap() = default;
  LobingMap(const Terms& terms_m, const Covariance& covariance_m2)
      : terms_m_(terms_m), covariance_m2_(covariance_m2) {}

  /// `normal` need not have unit length.
  [[nodiscard]] EffectiveRadius at(const Vector3& normal) const;
  [[nodiscard]] const Terms& terms_m() const { return terms_m_; }
  [[nodiscard]] const Covariance& covariance_m2() const { return covariance_m2_; }
  /// Values of the harmonic polynomials Y_0 ... Y_12 at a unit vector; Y_0 = 1.
  [[nodiscard]] static Terms basis(const Vector3& unit);

 private:
  Terms terms_m_ = Terms::Zero();
  Covariance covariance_m2_ = Covariance::Zero();
};

struct Qualification {
  Vector3 centre_m = Vector3::Zero();
  Matrix3 cov_centre_m2 = Matrix3::Zero();
  LobingMap map;
  double lobing_m = 0.0;  ///< largest minus smallest effective radius over the touched directions
  double residual_rms_m = 0.0;
  double sigma_m = 0.0;  ///< standard deviation of one touch
  double condition = 0.0;
  int freedom = 0;
};

/// Qualifies the probe. NotFinite; BadInput for a normal of zero length; TooFewObservations below
/// 24 touches; DegenerateGeometry if the touches cover too little of the sphere; NotConverged.
[[nodiscard]] Result<Qualification> qualify(std::span<const QualifyingTouch> touches,
                                            const QualificationOptions& options = {});

}  // namespace abbe::calib::probe
