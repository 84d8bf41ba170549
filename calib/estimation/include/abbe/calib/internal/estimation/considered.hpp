#pragma once
/// Unknowns that an adjustment considers but does not estimate ([Bierman 1977]: consider
/// parameters). The estimator takes them for zero; afterwards their uncertainty is added to that of
/// the estimate. The observations y = A U + B a + noise (U: estimated, a: considered) are given as
/// an Information about U, followed by a:
///     R = [R_U  R_a]     z = [z_U]
///         [ 0   ... ]        [...]
/// With a = 0 the estimate is U = R_U^-1 z_U. An error of a changes it by R_U^-1 R_a a, so that
///     Cov(U) = (R_U^T R_U)^-1 + K Cov(a) K^T,   K = R_U^-1 R_a

#include <Eigen/Core>
#include <cstddef>

#include "abbe/calib/estimation/information.hpp"

namespace abbe::calib::estimation {

/// Matrix K of this header: effect of the considered unknowns on the estimate of the first
/// `estimated` unknowns. Size: estimated x (unknowns() - estimated). Entries are not finite if the
/// data do not determine the estimated unknowns.
[[nodiscard]] Eigen::MatrixXd sensitivity(const Information&, std::size_t estimated);

}  // namespace abbe::calib::estimation
