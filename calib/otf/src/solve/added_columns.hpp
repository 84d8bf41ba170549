#pragma once
/// Columns added to an adjustment, and their effect on its result.

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "abbe/calib/otf/solve/solve.hpp"

namespace abbe::calib::otf {

/// Sums over the rows of an adjustment from which the normal equations for added columns C are
/// formed.
class AddedColumns {
 public:
  static constexpr std::size_t kMost = 18;  ///< largest number of columns of an alternative
                                            ///< (AlternativeColumns)

  AddedColumns(std::size_t columns, std::size_t unknowns);
  /// `values`: one value per added column in this row.
  void add(const Observation&, std::span<const SparseRows::Entry> row, double residual_m,
           std::span<const double> values);
  /// As add(), for a row in which few added columns are not zero. `values`: entries with the index
  /// of the column.
  void add(const Observation&, std::span<const SparseRows::Entry> row, double residual_m,
           std::span<const SparseRows::Entry> values);
  /// Adds sums for some of the columns and unknowns. `columns`, `unknowns`: their indices in this
  /// object.
  void add(const AddedColumns& part, const std::vector<std::size_t>& columns,
           const std::vector<std::size_t>& unknowns);
  /// The sums of the first `columns` columns only.
  [[nodiscard]] AddedColumns first(std::size_t columns) const;
  AddedColumns& operator+=(const AddedColumns&);
  AddedColumns& operator-=(const AddedColumns&);

  struct Estimate {
    double drop = 0.0;            ///< decrease of chi2
    std::size_t columns = 0;      ///< number of columns determined by the data
    Eigen::VectorXd d;            ///< coefficient of each added column
    Eigen::VectorXd u;            ///< standard uncertainty of d
    Eigen::VectorXd dU;           ///< Q A^T W^2 C d: error of U if the columns are left out
    Eigen::MatrixXd root_cov_d;   ///< root of the covariance of d: covariance = root root^T
    Eigen::MatrixXd root_cov_dU;  ///< root of the covariance of dU; together with root_cov_d it
                                  ///< gives the joint covariance of dU and d
    /// Only with a prior: 2 ln(marginal likelihood with the columns / likelihood without them).
    double twice_log_likelihood = 0.0;
  };
  /// Estimates d without a prior. Uses only the directions of d that decrease chi2 by at least
  /// `least_drop`. The other directions are noise, which would be amplified for columns that the
  /// model can almost reproduce. The weights of the rows are 1/sigma^2. Q: cofactor matrix of U.
  [[nodiscard]] Estimate estimate(const Eigen::MatrixXd& Q, double least_drop) const;
  /// Estimates d with the prior N(0, u^2) for every column; u > 0. The variances of the rows are
  /// `factor` times the stated ones.
  [[nodiscard]] Estimate estimate_with_prior(const Eigen::MatrixXd& Q, double u,
                                             double factor) const;
  [[nodiscard]] Estimate estimate_with_priors(const Eigen::MatrixXd& Q, const Eigen::VectorXd& u,
                                              double factor) const;

  /// The normal equations S d = g of the added columns after elimination of U, and the effect of d
  /// on U:
  ///     S = C^T W^2 C - C^T W^2 A Q A^T W^2 C,   g = C^T W^2 r,   dU = dU_dd d
  struct Reduced {
    Eigen::MatrixXd S;
    Eigen::VectorXd g;
    Eigen::MatrixXd dU_dd;
  };
  [[nodiscard]] Reduced reduced(const Eigen::MatrixXd& Q) const;

 private:
  Eigen::MatrixXd CWC_, CWA_;
  Eigen::VectorXd CWr_;
};

}  // namespace abbe::calib::otf
