#pragma once

#include <Eigen/Core>

#include "abbe/calib/estimation/information.hpp"

namespace abbe::calib::estimation {

/// 1 / length of every column; 1 for a column of zeros.
[[nodiscard]] Eigen::VectorXd column_scale(const Information&);

}  // namespace abbe::calib::estimation
