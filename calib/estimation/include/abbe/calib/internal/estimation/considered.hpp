#pragma once
/// Unknowns that an adjustment considers but does not estimate: the estimator takes them for zero,
/// and their uncertainty is added to that of the estimate afterwards ([Bierman 1977]: consider
/// parameters). Observations y = A U + B a + noise, U: estimated, a: considered, as an Information
/// about U, then a:
///     R = [R_U  R_a]     z = [z_U]
///         [ 0   ... ]        [...]
/// With a = 0 the estimate is U = R_U^-1 z_U. An error of a changes it by R_U^-1 R_a a, so that
///     Cov(U) = (R_U^T R_U)^-1 + K Cov(a) K^T,   K = R_U^-1 R_a

#include <Eigen/Core>
#include <cstddef>

#include "abbe/calib/estimation/information.hpp"

namespace abbe::calib::estimation {

/// K: effect of every other unknown on the estimate of the first `estimated` ones, estimated x
/// (unknowns() - estimated). Entries are not finite if the data do not determine the estimated
/// unknowns.
[[nodiscard]] Eigen::MatrixXd sensitivity(const Information&, std::size_t estimated);

}  // namespace abbe::calib::estimation
