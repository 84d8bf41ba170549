#pragma once
/// Information of the data of a run about the bends of its tables (smoothness.hpp). is_left_out():
/// true if the prior is not applied to this bend.

#include <Eigen/Core>
#include <vector>

#include "abbe/calib/internal/otf/run/table_bends.hpp"
#include "abbe/calib/otf/run/smoothness.hpp"

namespace abbe::calib::otf {

[[nodiscard]] bool is_left_out(const Smoothness&, const TableBend&);
/// Standard deviation of the prior of a bend.
[[nodiscard]] double sigma_of(const Smoothness&, const TableBend&);

/// Information about all bends if all other unknowns, constants and slopes included, may have any
/// value.
struct AboutBends {
  std::vector<TableBend> bends;
  Eigen::MatrixXd H;  ///< information matrix of the data with their stated noise
  Eigen::VectorXd g;
  double variance_factor = 1.0;
};
[[nodiscard]] AboutBends about_bends(const estimation::Information& data, const TableBasis&,
                                     double variance_factor);

/// Posterior of the bends. Each bend is divided by the standard deviation of its prior.
struct BendPosterior {
  Eigen::VectorXd mean;
  Eigen::MatrixXd Q;  ///< covariance; left-out bends are divided by sigma_of_unit * 100 um
};
[[nodiscard]] BendPosterior posterior_of(const AboutBends&, const Smoothness&);

}  // namespace abbe::calib::otf
