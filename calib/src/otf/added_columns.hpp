#pragma once
/// Columns added to an adjustment, and what they change.

#include <array>
#include <cstddef>
#include <span>

#include "abbe/calib/otf/solve.hpp"

namespace abbe::calib::otf {

/// Sums over rows of a few added columns C.
class AddedColumns {
 public:
  static constexpr std::size_t kMost = 18;

  AddedColumns(std::size_t columns, std::size_t unknowns);
  /// `values`: of each added column in this row.
  void add(const Observation&, std::span<const SparseRows::Entry> row, double residual_m,
           std::span<const double> values);
  AddedColumns& operator-=(const AddedColumns&);

  struct Estimate {
    double drop = 0.0;            ///< of chi2
    std::size_t columns = 0;      ///< that the data determine
    Eigen::VectorXd d;            ///< of each added column
    Eigen::VectorXd u;            ///< standard uncertainty of d
    Eigen::VectorXd dU;           ///< Q A^T W^2 C d: what U has of it without them
    Eigen::MatrixXd root_cov_dU;  ///< by that U is less certain with them: cov = root root^T
  };
  /// A direction of d counts that lowers chi2 by `least_drop` or more. Weaker ones are noise, which
  /// columns that the model almost follows would multiply. Weights of the rows are taken as
  /// 1/sigma^2.
  [[nodiscard]] Estimate estimate(const Eigen::MatrixXd& Q, double least_drop) const;
  /// With d ~ N(0, u^2) for every column, and variances of the rows that are `factor` times the
  /// stated ones.
  [[nodiscard]] Estimate estimate_with_prior(const Eigen::MatrixXd& Q, double u,
                                             double factor) const;

 private:
  Eigen::MatrixXd CWC_, CWA_;
  Eigen::VectorXd CWr_;
};

}  // namespace abbe::calib::otf
