#pragma once
/// The datum of an adjustment: conditions
///     K U = 0
/// that select one of the solutions U which describe the data equally well ([Baarda 1973]). The
/// data are given as R and z (information.hpp). If there are as many conditions as undetermined
/// combinations of U (datum defect; minimal constraints), the conditions do not change the fit: the
/// minimum of
///     |R U - z|^2 + mu |K U|^2
/// satisfies K U = 0 exactly for every mu > 0, because undetermined combinations of U can be
/// changed until K U = 0 without changing R U. With Q = (H + mu K^T K)^-1 and H = R^T R,
///     Cov(U) = Q H Q
/// (Q itself is too large: it also contains a variance for the conditions, which are exact.) With T
/// the triangular factor of [R; sqrt(mu) K] the covariance is computed without forming H:
///     Cov(U) = G G^T,   G = T^-1 (R T^-1)^T
/// If the weights W of the rows A are not 1/sigma, C being the covariance of the observations, R_n
/// replaces R in G:
///     A^T W^2 C W^2 A = R_n^T R_n

#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <string>
#include <utility>

#include "abbe/calib/base/error.hpp"
#include "abbe/calib/estimation/information.hpp"

namespace abbe::calib::estimation {

struct DatumSolution {
  Eigen::VectorXd U;           ///< satisfies K U = 0
  Eigen::MatrixXd covariance;  ///< Cov(U) = Q H Q; singular
  Eigen::MatrixXd cofactor_Q;  ///< Q above: derivative dU/dg for g = A^T W^2 y
  std::size_t rank = 0;        ///< rank of the data without the conditions
  std::size_t datum_defect = 0;
  /// condition number of R with columns scaled to unit length; singular values that count as zero
  /// are left out
  double condition = 0.0;
};

struct DatumOptions {
  /// mu of each condition is this weight divided by the squared length of its row of K. The columns
  /// of K are first scaled by the same factors that scale the columns of R to unit length.
  double weight = 1.0;
  /// Information whose R is R_n with A^T W^2 C W^2 A = R_n^T R_n (A: design, W: weights, C:
  /// covariance of the observations); null: the weights W are 1/sigma
  const Information* noise = nullptr;
  /// Singular values of the column-scaled data that are smaller than this fraction of the largest
  /// count as zero. Only effective if larger than the threshold for rounding (Spectrum::threshold).
  /// For data whose columns are known with less than machine precision.
  double zero = 0.0;
  /// returns the name of an unknown for messages
  std::function<std::string(std::size_t)> label;
};

/// Conditions of a datum; the object is immutable.
class Datum {
 public:
  /// One row per condition, one column per unknown.
  explicit Datum(Eigen::MatrixXd conditions) : K_(std::move(conditions)) {}

  [[nodiscard]] const Eigen::MatrixXd& conditions() const { return K_; }

  /// Adjusts the data with the conditions. RankDeficient if an unknown has no observation, or if
  /// the data leave more combinations undetermined than there are conditions. The text names only
  /// unknowns that are not determined.
  [[nodiscard]] Result<DatumSolution> solve(const Information&, const DatumOptions& = {}) const;
  /// The U of solve() without covariance, in less time: the rank is judged by column pivoting
  /// instead of singular values.
  [[nodiscard]] Result<Eigen::VectorXd> estimate(const Information&,
                                                 const DatumOptions& = {}) const;

  /// The matrix S of the S-transformation of a solution with another datum to this datum. N: the
  /// given basis of the combinations that the data leave undetermined, K: the conditions of this
  /// datum, S = I - N (K N)^-1 K,
  ///     U' = S U,   Cov' = S Cov S^T
  /// DegenerateGeometry if the conditions do not fix all combinations of N.
  [[nodiscard]] Result<Eigen::MatrixXd> transformation(const Eigen::MatrixXd& null_space) const;

 private:
  Eigen::MatrixXd K_;
};

}  // namespace abbe::calib::estimation
