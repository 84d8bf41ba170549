#include "solve/slow_noise.hpp"

#include <cmath>
#include <vector>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"
#include "abbe/calib/internal/evemu/solve/fit_coefficients.hpp"
#include "abbe/result/try.hpp"
#include "solve/most_likely_near.hpp"

namespace abbe::calib::evemu {
namespace {

/// Logarithm of the marginal likelihood of the observed errors, with slow noise of the size per_s
/// and with the array's uncertainty as columns.
Result<double> log_likelihood_with(double per_s, const FitProblem& problem,
                                   const HyperParameters& start) {
  const Observations o = with_slow_noise(problem.observations, per_s);
  Eigen::MatrixXd columns(problem.X.rows(), problem.X.cols() + problem.A.cols());
  columns << problem.X, problem.A;
  const std::vector<double> added(static_cast<std::size_t>(problem.A.cols()), 1.0);
  const LinearGaussian gaussian(white_rows(o, columns), white_rows(o, pose_rotation_rows(o)),
                                white_rows(o, problem.y));
  return most_likely_near(start, problem.design, o.positions(), gaussian, added)
      .map([&](const HyperParameters& h) { return h.log_likelihood - log_det_of_noise(o); })
      .map_error([&](const Error& e) {
        return Error{e.code, message("estimate with slow noise of ", per_s,
                                     " times the noise of a ball centre: ", e.text)};
      });
}

}  // namespace

std::string slow_noise_text(double slow_noise_m) {
  return message("slow noise: within positions all touches shift by ", slow_noise_m * kUmPerM,
                 " um (standard deviation): vibration, temperature, a probe with poor "
                 "repeatability, or machine errors that polynomials of the configured order do not "
                 "describe");
}

Observations with_slow_noise(const Observations& o, double per_s) {
  Observations with = o;
  with.slow_noise = per_s;
  return with;
}

Result<SlowNoise> likely_slow_noise(const Observations& o, const ScaledDesign& design,
                                    const HyperParameters& start) {
  const FitProblem problem = problem_of(o, design, {});
  const Result<double> without = log_likelihood_with(0.0, problem, start);
  ABBE_TRY(without);

  SlowNoise best;
  const auto consider = [&](double per_s) -> Result<void> {
    return log_likelihood_with(per_s, problem, start).map([&](double value) {
      if (value - *without > best.log_likelihood) {
        best = {per_s, value - *without};
      }
    });
  };

  for (const double per_s : {0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0}) {
    ABBE_TRY(consider(per_s));
  }

  if (best.per_s == 0.0) {
    return best;
  }

  const double coarse = best.per_s;
  for (const double factor : {std::sqrt(0.5), std::sqrt(2.0)}) {
    ABBE_TRY(consider(coarse * factor));
  }

  return best;
}

}  // namespace abbe::calib::evemu
