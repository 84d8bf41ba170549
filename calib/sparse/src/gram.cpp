#include "gram.hpp"

#include <cmath>
#include <utility>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/result/try.hpp"

namespace abbe::calib::sparse {
namespace {

/// If the standard deviation of y relative to its size is at most this, y counts as constant:
/// rounding can cause a deviation of this size.
constexpr double kConstantY = 1e-14;

Result<void> check_shapes(const Eigen::MatrixXd& X, const Eigen::VectorXd& y) {
  if (X.rows() != y.size()) {
    return failure(ErrorCode::BadInput, message("sparse regression: ", X.rows(),
                                                " rows in the design, ", y.size(), " in y"));
  }
  if (!y.allFinite())
    return failure(ErrorCode::NotFinite, "sparse regression: NaN or infinity in y");
  if (y.size() < 2) {
    return failure(ErrorCode::TooFewObservations,
                   message("sparse regression: ", y.size(), " row(s), needs at least 2"));
  }
  return {};
}

}  // namespace

Result<GramProblem> gram_problem(const Eigen::MatrixXd& X, const Eigen::VectorXd& y) {
  ABBE_TRY(check_shapes(X, y));
  auto design = standardise(X);
  ABBE_TRY(design);
  GramProblem problem;
  problem.design = std::move(*design);
  problem.y_mean = y.mean();
  problem.y = y.array() - problem.y_mean;
  const auto n = static_cast<double>(y.size());
  problem.y_rms = std::sqrt(problem.y.squaredNorm() / n);

  if (!std::isfinite(problem.y_rms)) {
    return failure(ErrorCode::NotFinite,
                   "sparse regression: squares of y are too large for a double");
  }

  if (problem.y_rms <= kConstantY * y.cwiseAbs().maxCoeff()) {
    return failure(ErrorCode::TooFewObservations,
                   message("sparse regression: y does not vary over ", y.size(), " rows"));
  }

  const Eigen::MatrixXd& Z = problem.design.X;
  problem.gram = Z.transpose() * Z / n;
  problem.gram = problem.gram.selfadjointView<Eigen::Lower>();
  problem.xty = Z.transpose() * problem.y / n;

  return problem;
}

}  // namespace abbe::calib::sparse
