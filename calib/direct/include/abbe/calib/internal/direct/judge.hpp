#pragma once
/// Differences at the positions of one error and the verdict on them.

#include <Eigen/Core>

#include "abbe/calib/direct/compare.hpp"

namespace abbe::calib::direct {

/// Covariances of the values after the convention.
struct PointCovariances {
  Eigen::MatrixXd runs, device, model;
};

/// Fills points and statistics of the table; `measured` and `model` are after the convention.
void add_points(TableComparison&, const Runs&, const Eigen::VectorXd& measured,
                const Eigen::VectorXd& model, const PointCovariances&, bool uncertainty_known);

[[nodiscard]] std::size_t count_tests(const TableComparison&);

/// Quantiles for one test: Student's and normal distribution; see compare.hpp.
struct Limits {
  double student = 0.0, normal = 0.0;
};
/// p: probability of a false alarm of one test; dof: 0 if the scatter of the runs is not known.
[[nodiscard]] Limits limits_of(double p, std::size_t dof);
/// Limit of a |difference| with the variance `variance`; `variance_runs` is the part of it from the
/// scatter of the runs.
[[nodiscard]] double limit_of(const Limits&, double variance_runs, double variance);

/// Sets the limits of the points and the finding.
void judge(TableComparison&, const Limits&);

}  // namespace abbe::calib::direct
