#pragma once
/// Estimates the errors by the sequence of [Viprey 2016]; see solve.hpp.

#include "abbe/calib/mfb/solve/solve.hpp"

namespace abbe::calib::mfb {

[[nodiscard]] Result<Solution> solve_sequential(const Observations&, const SolveOptions&);

/// Derivatives of the parameters by the deviations of each pass, parameters x 3N.
[[nodiscard]] Result<std::vector<Eigen::MatrixXd>> sequential_derivatives(const Observations&);

}  // namespace abbe::calib::mfb
