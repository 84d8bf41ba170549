#pragma once
/// All that observations state about the unknowns U of a linear problem, in square-root form
/// ([Bierman 1977]): R upper triangular, z and a rest with
///     |R U - z|^2 + rest = |W (A U - y)|^2   for every U,   W^T W = Cov(y)^-1
/// The information matrix is H = R^T R, but H is never formed: its condition is the square of that
/// of W A, so that half of the digits would be lost. Rows are added by Householder reflections
/// ([Golub 2013] section 5.2), each over one column of R and of a batch of rows. R is unique (its
/// diagonal is not negative), except for rounding it does not depend on the order of the rows. The
/// same rows in the same order give the same bits on every processor.

#include <Eigen/Core>
#include <cstddef>
#include <map>
#include <span>
#include <vector>

#include "abbe/calib/error.hpp"
#include "abbe/calib/estimation/block.hpp"
#include "abbe/calib/estimation/row_batch.hpp"

namespace abbe::calib::estimation {

class Information {
 public:
  /// Of no observations: R = 0.
  explicit Information(std::size_t unknowns);

  [[nodiscard]] std::size_t unknowns() const { return unknowns_; }
  /// Number of rows added, less the nuisances that were eliminated: rows() - rank are the degrees
  /// of freedom.
  [[nodiscard]] std::size_t rows() const { return rows_; }
  [[nodiscard]] Eigen::MatrixXd R() const;
  [[nodiscard]] Eigen::VectorXd z() const;
  [[nodiscard]] double rest() const { return rest_; }
  /// Squared length of the column of an unknown; zero: nothing observes it.
  [[nodiscard]] double squared_length(std::size_t unknown) const;

  /// Adds the rows of the batch and clears it.
  void add(RowBatch&);
  /// Adds whitened rows.
  void add_rows(const Eigen::MatrixXd& A, const Eigen::VectorXd& y);
  /// Whitens the rows and eliminates the nuisances of the block. BadInput for wrong sizes,
  /// DegenerateGeometry if the covariance is not positive definite.
  [[nodiscard]] Result<void> add(const Block&);
  /// Adds the prior U_unknown ~ N(value, u^2) as one row.
  void add_prior(std::size_t unknown, double value, double u);
  /// Adds independent observations of the same unknowns.
  Information& operator+=(const Information&);
  /// The same for information about some of the unknowns: `at`: index here of each unknown of
  /// `part`, ascending.
  void add(const Information& part, std::span<const std::size_t> at);
  /// Multiplies all weights by `factor`, 0 to 1: older observations count less.
  void forget(double factor);

  /// Information about the other unknowns, in their order, when the given ones are unknown
  /// (marginalisation). `eliminated` must not repeat an unknown.
  [[nodiscard]] Information without_unknowns(std::span<const std::size_t> eliminated) const;

 private:
  [[nodiscard]] double* row(std::size_t i) { return values_.data() + i * (unknowns_ + 1); }
  [[nodiscard]] const double* row(std::size_t i) const {
    return values_.data() + i * (unknowns_ + 1);
  }
  /// `rows`: `count` rows [A | y], which are overwritten.
  void add_dense(double* rows, std::size_t count);

  std::size_t unknowns_ = 0, rows_ = 0;
  std::vector<double> values_;  ///< [R | z] by rows
  double rest_ = 0.0;
};

/// Information of each group of blocks. Whitening never crosses a group, so that a group can be
/// left out without reading observations again.
class InformationByGroup {
 public:
  explicit InformationByGroup(std::size_t unknowns) : unknowns_(unknowns) {}

  [[nodiscard]] Result<void> add(const Block&);
  [[nodiscard]] std::vector<std::size_t> groups() const;
  /// Of no observations if there is no such group.
  [[nodiscard]] Information of(std::size_t group) const;
  [[nodiscard]] Information all() const;
  [[nodiscard]] Information without(std::size_t group) const;

 private:
  std::size_t unknowns_ = 0;
  std::map<std::size_t, Information> parts_;
};

}  // namespace abbe::calib::estimation
