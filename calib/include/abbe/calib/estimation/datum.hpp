#pragma once
/// The datum of an adjustment: conditions
///     K U = 0
/// that select one of the solutions which describe the data equally well ([Baarda 1973]). With as
/// many conditions as the datum defect (minimal constraints) they do not change the fit:
///     minimise |R U - z|^2 + mu |K U|^2
/// meets them exactly for every mu > 0, because a combination that no observation sees can meet
/// them at no cost. With Q = (H + mu K^T K)^-1 and H = R^T R,
///     Cov(U) = Q H Q
/// Q alone contains the part of the datum. With T the triangle of [R; sqrt(mu) K] this is
///     Cov(U) = G G^T,   G = T^-1 (R T^-1)^T
/// which is never formed from H. If the rows were weighted otherwise than with 1/sigma, the factor
/// of the noise replaces R in G: W^2 C W^2 = R_n^T R_n.

#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <string>
#include <utility>

#include "abbe/calib/error.hpp"
#include "abbe/calib/estimation/information.hpp"

namespace abbe::calib::estimation {

struct DatumSolution {
  Eigen::VectorXd U;           ///< meets K U = 0
  Eigen::MatrixXd covariance;  ///< Q H Q; singular
  Eigen::MatrixXd cofactor_Q;  ///< dU/dg for g = A^T W^2 y
  std::size_t rank = 0;        ///< of the data
  std::size_t datum_defect = 0;
  /// of the column-scaled data within their rank
  double condition = 0.0;
};

struct DatumOptions {
  /// factor of mu, which is 1 over the squared length of each scaled condition
  double weight = 1.0;
  /// root of the noise: A^T W^2 C W^2 A = R_n^T R_n; null: the weights are 1/sigma^2
  const Information* noise = nullptr;
  /// name of an unknown in messages
  std::function<std::string(std::size_t)> label;
};

/// Immutable value.
class Datum {
 public:
  /// One row per condition, one column per unknown.
  explicit Datum(Eigen::MatrixXd conditions) : K_(std::move(conditions)) {}

  [[nodiscard]] const Eigen::MatrixXd& conditions() const { return K_; }

  /// RankDeficient if an unknown has no observation, or if the data leave more combinations
  /// undetermined than there are conditions; the text names unknowns that are not determined.
  [[nodiscard]] Result<DatumSolution> solve(const Information&, const DatumOptions& = {}) const;
  /// U alone, in less time: the rank is judged by column pivoting instead of singular values.
  [[nodiscard]] Result<Eigen::VectorXd> estimate(const Information&,
                                                 const DatumOptions& = {}) const;

  /// The S-transformation to this datum, S = I - N (K N)^-1 K, N: basis of the null space:
  ///     U' = S U,   Cov' = S Cov S^T
  /// DegenerateGeometry if the conditions do not fix all combinations of N.
  [[nodiscard]] Result<Eigen::MatrixXd> transformation(const Eigen::MatrixXd& null_space) const;

 private:
  Eigen::MatrixXd K_;
};

}  // namespace abbe::calib::estimation
