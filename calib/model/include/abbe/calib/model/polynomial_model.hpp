#pragma once
/// The volumetric error as an equivalent model: V(q) = B(q) c in scaled Legendre polynomials, for
/// one tool offset, zero at Ball1. Uncertainty from the full covariance of c. Extrapolates outside
/// the hull of the balls without limit: the caller must also check the validity volume.

#include <Eigen/Core>
#include <array>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/geometry/scaled_design.hpp"

namespace abbe::calib {

/// Coefficient of [Li OMM] Table 3: mm^(1-order) for translations, rad mm^-order for rotations.
struct NamedCoefficient {
  std::string name;
  double value = 0.0;
  double u = 0.0;
  std::string unit;  ///< such as "mm", "1", "mm^-1", "rad/mm"
};

/// Coefficients c of a scaled design with their covariance. Immutable; all members may be called
/// from any thread.
class PolynomialModel {
 public:
  /// Returns BadInput or NotFinite unless c and its covariance have the size of the design and the
  /// covariance is symmetric without a negative variance. c and covariance are stored unchanged:
  /// for V(Ball1) = 0 the caller applies zero_at() before.
  [[nodiscard]] static Result<PolynomialModel> of(ScaledDesign, const Vector3& ball1_m,
                                                  Eigen::VectorXd c_m,
                                                  const Eigen::MatrixXd& covariance_m2);

  [[nodiscard]] const ScaledDesign& design() const { return design_; }
  [[nodiscard]] const Vector3& ball1_m() const { return ball1_m_; }
  [[nodiscard]] const Eigen::VectorXd& c_m() const { return c_m_; }
  [[nodiscard]] const Eigen::MatrixXd& covariance_m2() const { return covariance_m2_; }

  /// V at a reading. Does not allocate.
  [[nodiscard]] Vector3 V_at(const Vector3& reading_m) const;
  /// V and its covariance at a reading. Takes well below a microsecond in an optimised build. Does
  /// not allocate.
  void V_and_cov_at(const Vector3& reading_m, Vector3& V_m, Matrix3& cov_m2) const;

  /// The coefficients of the equivalent model (equivalent_model.hpp), in the order of its names.
  [[nodiscard]] std::vector<NamedCoefficient> named_coefficients() const;

 private:
  explicit PolynomialModel(ScaledDesign design) : design_(std::move(design)) {}

  /// One product of polynomials in one component of V. The entries are sorted by component.
  struct Entry {
    DesignFunction::Part part;
    std::size_t axis = 0, order = 0;
    double c_m = 0.0;
  };
  ScaledDesign design_;
  Vector3 ball1_m_ = Vector3::Zero();
  Eigen::VectorXd c_m_;
  Eigen::MatrixXd covariance_m2_;
  std::vector<Entry> entries_;
  std::array<std::size_t, 4> first_{};  ///< index of each component's first entry, and the end
  Eigen::MatrixXd entry_covariance_;    ///< covariance of the entries; blocks of one component are
                                        ///< contiguous
};

/// Matrix T such that the model with the coefficients T c has V = 0 at the place: T subtracts the
/// original V(place) = B(place) c from the constants.
[[nodiscard]] Eigen::MatrixXd zero_at(const ScaledDesign&, const Vector3& place_m);

}  // namespace abbe::calib
