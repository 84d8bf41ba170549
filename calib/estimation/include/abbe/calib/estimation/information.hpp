#pragma once
/// The information of observations y = A U + noise about the unknowns U, in square-root form
/// ([Bierman 1977]): an upper triangular matrix R, a vector z and a number `rest` with
///     |R U - z|^2 + rest = |W (A U - y)|^2   for every U,   W^T W = Cov(y)^-1
/// The information matrix is H = R^T R. H is never formed: its condition number is the square of
/// that of W A, so that half of the digits would be lost. Rows are added by Householder reflections
/// ([Golub 2013] section 5.2), each over one column of R and of a batch of rows. The diagonal of R
/// is not negative, which makes R unique: except for rounding R does not depend on the order of the
/// rows. The same rows in the same order give the same bits on every processor.

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <vector>

#include "abbe/calib/base/error.hpp"
#include "abbe/calib/estimation/observation_group.hpp"
#include "abbe/calib/estimation/row_batch.hpp"

namespace abbe::calib::estimation {

class Information {
 public:
  /// Starts without observations: R = 0.
  explicit Information(std::size_t unknowns);

  [[nodiscard]] std::size_t unknowns() const { return unknowns_; }
  /// Number of rows added minus the number of nuisances that were eliminated. rows() - rank is the
  /// number of degrees of freedom.
  [[nodiscard]] std::size_t rows() const { return rows_; }
  [[nodiscard]] Eigen::MatrixXd R() const;
  [[nodiscard]] Eigen::VectorXd z() const;
  [[nodiscard]] double rest() const { return rest_; }
  /// Squared length of the column of R of an unknown; zero if no row contains the unknown.
  [[nodiscard]] double squared_length(std::size_t unknown) const;

  /// Adds the rows of the batch and clears it.
  void add(RowBatch&);
  /// Adds rows that are already whitened (unit variance, independent).
  void add_rows(const Eigen::MatrixXd& A, const Eigen::VectorXd& y);
  /// Whitens the rows and eliminates the nuisances of the group. BadInput for wrong sizes,
  /// DegenerateGeometry if the covariance is not positive definite.
  [[nodiscard]] Result<void> add(const ObservationGroup&);
  /// Adds the prior U_unknown ~ N(value, u^2) as one row.
  void add_prior(std::size_t unknown, double value, double u);
  /// Adds `rows` rows that contain no unknowns; `squares` is the sum of squares of their y.
  void add_rest(double squares, std::size_t rows) {
    rest_ += squares;
    rows_ += rows;
  }
  /// Adds independent observations of the same unknowns.
  Information& operator+=(const Information&);
  /// Adds independent observations of some of the unknowns. Unknown k of `part` is unknown at[k] of
  /// this object; `at` ascends.
  void add(const Information& part, std::span<const std::size_t> at);
  /// Multiplies the information H of all observations added so far by `factor` (0 to 1), so that
  /// observations added later have more weight.
  void forget(double factor);

  /// Information about the remaining unknowns, in their order, when the unknowns in `eliminated`
  /// may have any value (marginalisation). `eliminated` must not repeat an unknown.
  [[nodiscard]] Information without_unknowns(std::span<const std::size_t> eliminated) const;

 private:
  [[nodiscard]] double* row(std::size_t i) { return values_.data() + i * (unknowns_ + 1); }
  [[nodiscard]] const double* row(std::size_t i) const {
    return values_.data() + i * (unknowns_ + 1);
  }
  /// `rows`: `count` rows [A | y], which are overwritten.
  void add_dense(double* rows, std::size_t count);

  std::size_t unknowns_ = 0, rows_ = 0;
  std::vector<double> values_;  ///< the matrix [R | z], stored by rows
  double rest_ = 0.0;
};

}  // namespace abbe::calib::estimation
