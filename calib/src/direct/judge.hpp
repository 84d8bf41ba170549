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
                const Eigen::VectorXd& model, const PointCovariances&);

[[nodiscard]] std::size_t count_tests(const TableComparison&);

/// Sets the finding; `limit`: of the probability of each test.
void judge(TableComparison&, double limit);

}  // namespace abbe::calib::direct
