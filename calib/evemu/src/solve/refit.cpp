#include "solve/refit.hpp"

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "abbe/calib/evemu/solve/linear_gaussian.hpp"
#include "abbe/calib/evemu/solve/noise.hpp"
#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/evemu/solve/fit_coefficients.hpp"
#include "abbe/result/try.hpp"
#include "solve/most_likely_near.hpp"
#include "solve/norm_over_balls.hpp"

namespace abbe::calib::evemu {

Result<RunRows> run_rows(const Observations& o, const ScaledDesign& design,
                         const Solution& solution) {
  const FitProblem problem = problem_of(o, design, {});
  RunRows rows{.o = o,
               .design = design,
               .positions = o.positions(),
               .X = white_rows(o, problem.X),
               .S = white_rows(o, pose_rotation_rows(o)),
               .A = white_rows(o, problem.A),
               .y = white_rows(o, problem.y),
               .hyper = {},
               .norm = norm_over_balls(o, design)};

  if (solution.estimator == Estimator::BayesPose && solution.hyper && solution.slow_noise == 0.0) {
    rows.hyper = *solution.hyper;
    return rows;
  }

  const auto hyper = most_likely(PriorKind::BayesPose, design, rows.positions,
                                 LinearGaussian(rows.X, rows.S, rows.y));
  ABBE_TRY(hyper);

  rows.hyper = *hyper;
  return rows;
}

Result<Refit> refit_to(const Eigen::VectorXd& y, const RunRows& rows, const ScaledDesign& design,
                       const Eigen::MatrixXd& X, const Eigen::MatrixXd& C, double size_m) {
  Eigen::MatrixXd all(X.rows(), X.cols() + rows.A.cols() + C.cols());
  all << X, rows.A, C;
  std::vector<double> added(static_cast<std::size_t>(rows.A.cols()), 1.0);
  added.resize(added.size() + static_cast<std::size_t>(C.cols()), size_m * size_m);
  const LinearGaussian gaussian(all, rows.S, y);
  const auto hyper = most_likely_near(rows.hyper, design, rows.positions, gaussian, added);

  ABBE_TRY(hyper);

  const Eigen::VectorXd prior = with_added(
      prior_variances(PriorKind::BayesPose, design, rows.positions, *hyper), design.size(), added);
  const auto p = gaussian.posterior(prior, hyper->s_m * hyper->s_m);

  if (!p.mean.allFinite() || !p.covariance.allFinite()) {
    return failure(ErrorCode::NotConverged, message("bayes: no solution at s = ", hyper->s_m,
                                                    " m, w = ", hyper->w_rad, " rad"));
  }

  const Eigen::Index n = X.cols();
  return Refit{*hyper, p.mean.head(n), p.mean.segment(n + rows.A.cols(), C.cols()),
               p.covariance.topLeftCorner(n, n)};
}

Result<Refit> refit(const RunRows& rows, const ScaledDesign& design, const Eigen::MatrixXd& X,
                    const Eigen::MatrixXd& C, double size_m) {
  return refit_to(rows.y, rows, design, X, C, size_m);
}

Result<Refit> base_refit(const RunRows& rows) {
  return refit(rows, rows.design, rows.X, Eigen::MatrixXd(rows.X.rows(), 0), 1.0);
}

}  // namespace abbe::calib::evemu
