#pragma once
/// The equivalent volumetric error model: the combinations of error coefficients that measurements
/// of E can tell apart. Algorithm 1 of [Li OMM] combines like terms: for every monomial of every
/// component of A, the row of all its factors, kept unless it or its negative is there already. The
/// rows are W; beta = W K, X = A W^+, E = X beta. With one tool offset W has full row rank, so X is
/// the only solution of A = X W, and its columns are plain monomials (one, or for a rotation with
/// two arms one in each of two components). Named as in [Li OMM] Table 3: a row of one coefficient
/// has its name; a merged row is k_eq<component><n>, numbered within the component by decreasing
/// x > y > z > 1. Sign: a single coefficient counts +1, a merged row has its translations with +1.
/// Rows in alphabetical order. mm.

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/evemu/error_polynomials.hpp"

namespace abbe::calib::evemu {

/// Where a column of X is not zero.
struct Share {
  std::size_t component = 0;
  Monomial monomial;
  double factor = 1.0;
};

/// Immutable value; for one tool offset.
class EquivalentModel {
 public:
  /// BadInput for an order out of range. The offset changes W, never the names, the rank or the
  /// span of X.
  [[nodiscard]] static Result<EquivalentModel> of(const KinematicChain&, int order,
                                                  const Vector3& tool_offset_mm = Vector3::Zero());

  [[nodiscard]] const KinematicChain& chain() const { return chain_; }
  [[nodiscard]] int order() const { return order_; }
  [[nodiscard]] std::size_t size() const { return names_.size(); }  ///< 14 (order + 1) - 11
  [[nodiscard]] std::span<const std::string> names() const { return names_; }
  [[nodiscard]] std::span<const std::string> coefficient_names() const {
    return coefficient_names_;
  }  ///< of K
  [[nodiscard]] const Eigen::MatrixXd& W() const { return W_; }
  [[nodiscard]] std::span<const Share> shares(std::size_t column) const { return shares_[column]; }
  /// 3 x size(). Its columns span 20 orders of magnitude: for numbers use ScaledDesign.
  [[nodiscard]] Eigen::Matrix3Xd X(const Vector3& p_mm) const;

 private:
  KinematicChain chain_;
  int order_ = 0;
  std::vector<std::string> names_, coefficient_names_;
  Eigen::MatrixXd W_;
  std::vector<std::vector<Share>> shares_;
};

/// How many combinations measurements with all these tools (mm) can tell apart: for order 3, 45
/// with one, 56 with two that are not parallel, 60 with three or more.
[[nodiscard]] Result<std::size_t> observable_combinations(const KinematicChain&, int order,
                                                          std::span<const Vector3> tool_offsets_mm);

}  // namespace abbe::calib::evemu
