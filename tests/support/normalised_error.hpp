#pragma once
/// Error of a model relative to its stated covariance.

#include <Eigen/Eigenvalues>

#include "otf_run.hpp"

namespace abbe::tests::otf {

/// Squared error of the parameters in the metric of their covariance, per determined combination.
inline double normalised_error_square(const MadeRun& run, const calib::VolumetricModel& model) {
  const Eigen::VectorXd error = model.U() - run.truth;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> of(model.covariance());
  const double least = 1e-9 * of.eigenvalues().maxCoeff();
  double sum = 0.0, combinations = 0.0;
  for (Eigen::Index i = 0; i < error.size(); ++i) {
    if (of.eigenvalues()(i) > least) {
      const double along = of.eigenvectors().col(i).dot(error);
      sum += along * along / of.eigenvalues()(i);
      combinations += 1.0;
    }
  }
  return sum / combinations;
}

}  // namespace abbe::tests::otf
