#pragma once
/// The equivalent volumetric error model: the combinations of the error coefficients K that
/// measurements of the volumetric error E = A(x, y, z) K (error_polynomials.hpp) can distinguish.
/// Algorithm 1 of [Li OMM] combines like terms: for every monomial of every component of A it takes
/// the row of that monomial's factors over all coefficients. The row is added to the matrix W
/// unless W already contains this row or its negative. Then, with beta the combinations,
///     beta = W K,  X = A W^+,  E = X beta.
/// With one tool offset W has full row rank, so X is the only solution of A = X W. The columns of X
/// are single monomials (for a rotation with two arms: one in each of two components). Names as in
/// [Li OMM] Table 3: a row with one coefficient has the name of that coefficient; a merged row is
/// k_eqX1, k_eqX2, ..., numbered within the component X by decreasing x > y > z > 1. Sign: a single
/// coefficient has the factor +1; in a merged row the translations have the factor +1. Rows are in
/// alphabetical order. Lengths in mm.

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/geometry/error_polynomials.hpp"

namespace abbe::calib {

/// One nonzero term of a column of X: `component` of the column contains factor * monomial.
struct PolynomialShare {
  std::size_t component = 0;
  Monomial monomial;
  double factor = 1.0;
};

/// The equivalent model for one kinematic chain, order and tool offset. Immutable.
class EquivalentModel {
 public:
  /// Returns BadInput for an order outside kLeastOrder to kMostOrder. The tool offset changes W,
  /// but not the names, the rank or the space that the columns of X span.
  [[nodiscard]] static Result<EquivalentModel> of(const KinematicChain&, int order,
                                                  const Vector3& tool_offset_mm = Vector3::Zero());

  [[nodiscard]] const KinematicChain& chain() const { return chain_; }
  [[nodiscard]] int order() const { return order_; }
  /// 14 (order + 1) - 11 combinations
  [[nodiscard]] std::size_t size() const { return names_.size(); }
  [[nodiscard]] std::span<const std::string> names() const { return names_; }
  [[nodiscard]] const Eigen::MatrixXd& W() const { return W_; }
  [[nodiscard]] std::span<const PolynomialShare> shares(std::size_t column) const {
    return shares_[column];
  }
  /// The matrix X at the reading p, 3 x size(). The sizes of its columns span 20 orders of
  /// magnitude: use ScaledDesign for computations.
  [[nodiscard]] Eigen::Matrix3Xd X(const Vector3& p_mm) const;

 private:
  KinematicChain chain_;
  int order_ = 0;
  std::vector<std::string> names_;
  Eigen::MatrixXd W_;
  std::vector<std::vector<PolynomialShare>> shares_;
};

}  // namespace abbe::calib
