#pragma once
/// What the data of a run state about the bends of its tables (smoothness.hpp).

#include <Eigen/Core>
#include <vector>

#include "abbe/calib/internal/otf/run/table_bends.hpp"
#include "abbe/calib/otf/run/smoothness.hpp"

namespace abbe::calib::otf {

[[nodiscard]] bool is_left_out(const Smoothness&, const TableBend&);
/// Standard deviation of the prior of a bend.
[[nodiscard]] double sigma_of(const Smoothness&, const TableBend&);

/// Information about all bends if constants, slopes and all other unknowns may have any value.
struct AboutBends {
  std::vector<TableBend> bends;
  Eigen::MatrixXd H;  ///< of the data with their stated noise
  Eigen::VectorXd g;
  double variance_factor = 1.0;
};
[[nodiscard]] AboutBends about_bends(const estimation::Information& data, const TableBasis&,
                                     double variance_factor);

/// The posterior of the bends, each in units of the standard deviation of its prior.
struct BendPosterior {
  Eigen::VectorXd mean;
  Eigen::MatrixXd Q;  ///< covariance; a bend without the prior has its own unit
};
[[nodiscard]] BendPosterior posterior_of(const AboutBends&, const Smoothness&);

}  // namespace abbe::calib::otf
