#include "solve/linear_estimator.hpp"

#include "abbe/calib/internal/mfb/solve/simultaneous.hpp"
#include "solve/sequential.hpp"

namespace abbe::calib::mfb {

Result<LinearEstimator> linear_estimator(const Observations& o, const SolveOptions& options) {
  if (options.estimator == Estimator::Sequential) {
    return sequential_derivatives(o).map(
        [](std::vector<Eigen::MatrixXd> of_pass) { return LinearEstimator{std::move(of_pass)}; });
  }

  return whole_system(o, nuisance_options(options)).map([&](const WholeSystem& system) {
    const Eigen::MatrixXd C = estimate_of(system).covariance.topRows(system.shared.parameters());
    LinearEstimator estimator;
    estimator.of_pass.resize(o.passes.size());
    for (const PositionSystem& s : system.positions) {
      const Eigen::MatrixXd H = system.shared.expanded(C * gain_rows(s));
      for (std::size_t k = 0; k < s.passes.size(); ++k) {
        estimator.of_pass[s.passes[k]] =
            H.middleCols(s.rows_of_pass * static_cast<Eigen::Index>(k), s.rows_of_pass);
      }
    }
    return estimator;
  });
}

}  // namespace abbe::calib::mfb
