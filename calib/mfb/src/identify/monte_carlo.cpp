#include "abbe/calib/mfb/identify/monte_carlo.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/mfb/observe/quick_extraction.hpp"
#include "abbe/calib/internal/mfb/solve/shared_unknowns.hpp"
#include "abbe/calib/internal/statistics/elementary.hpp"
#include "abbe/result/try.hpp"
#include "solve/linear_estimator.hpp"

namespace abbe::calib::mfb {
namespace {

/// One simulated pass. `tips_m`: centres of the tip in bar axes, as read by the machine with the
/// identified errors, without noise.
struct SimulatedPass {
  std::vector<Vector3> tips_m;
  std::vector<Vector3> normals;
  QuickExtraction extraction;
};

SimulatedPass simulated_pass(const Observations& o, const PassObservation& pass,
                             const std::vector<NominalTouch>& touches, const Eigen::VectorXd& U) {
  const Matrix3& axes = o.positions[pass.position].pose.axes;
  const Vector3& tool_m = o.plan.measurements[pass.measurement].tool_offset_m;
  SimulatedPass simulated{
      {}, {}, QuickExtraction(o.bar.pattern, o.plan.tip_radius_m, pass.touched)};
  for (std::size_t k = 0; k < pass.touched.size(); ++k) {
    const NominalTouch& touch = touches[pass.touched[k]];
    const Vector3 V_m = o.basis.V_m({.q_m = pass.reading_m[k], .tool_offset_m = tool_m},
                                    {U.data(), static_cast<std::size_t>(U.size())});
    simulated.tips_m.emplace_back(touch.tip_m - axes.transpose() * V_m);
    simulated.normals.push_back(touch.outward);
  }
  return simulated;
}

/// Points of interest of the nominal bar in the bar frame.
Result<std::vector<Vector3>> nominal_points(const Observations& o,
                                            const std::vector<NominalTouch>& touches) {
  std::vector<std::size_t> all;
  std::vector<Vector3> tips_m;
  for (const NominalTouch& touch : touches) {
    all.push_back(all.size());
    tips_m.push_back(touch.tip_m);
  }
  return QuickExtraction(o.bar.pattern, o.plan.tip_radius_m, all)(tips_m).map(
      [](const BarPoints& points) {
        std::vector<Vector3> O_m;
        for (const Vector3& O : points.O_m) {
          O_m.emplace_back(points.pose.axes.transpose() * (O - points.pose.origin_m));
        }
        return O_m;
      });
}

class Trials {
 public:
  Trials(const Observations& o, LinearEstimator estimator, std::vector<Vector3> O_m,
         std::uint64_t seed)
      : o_(o), estimator_(std::move(estimator)), O_m_(std::move(O_m)), shared_(o), random_(seed) {}

  void add_pass(SimulatedPass pass) { passes_.push_back(std::move(pass)); }
  /// Simulates one trial and returns the parameters estimated from it.
  [[nodiscard]] Result<Eigen::VectorXd> next();

 private:
  [[nodiscard]] Result<BarPoints> touched(SimulatedPass&);
  /// Errors of the calibrated points in a pass: calibration, alpha, temperature.
  struct BarErrors {
    Eigen::VectorXd calibration_m;
    double alpha_per_K = 0.0;
    std::vector<double> temperature_K;  ///< for each position
  };
  [[nodiscard]] BarErrors drawn_errors();

  const Observations& o_;
  LinearEstimator estimator_;
  std::vector<Vector3> O_m_;
  SharedUnknowns shared_;
  NormalDeviates random_;
  std::vector<SimulatedPass> passes_;
  std::vector<Vector3> noisy_m_;
};

Result<BarPoints> Trials::touched(SimulatedPass& pass) {
  const double probe_m = o_.plan.noise.probe_m, machine_m = o_.plan.noise.machine_m;
  noisy_m_.resize(pass.tips_m.size());
  for (std::size_t k = 0; k < pass.tips_m.size(); ++k) {
    const double x = random_.next(), y = random_.next(), z = random_.next();
    const double along = probe_m * random_.next();
    noisy_m_[k] = pass.tips_m[k] + machine_m * Vector3(x, y, z) + along * pass.normals[k];
  }
  return pass.extraction(noisy_m_);
}

Trials::BarErrors Trials::drawn_errors() {
  BarErrors errors;
  Eigen::VectorXd g(shared_.bar_root().cols());
  for (Eigen::Index k = 0; k < g.size(); ++k) {
    g(k) = random_.next();
  }
  errors.calibration_m = shared_.bar_root() * g;
  errors.alpha_per_K = shared_.u_alpha_per_K() * random_.next();
  const TouchNoise& noise = o_.plan.noise;
  const double common_K =
      noise.common_temperature_K() > 0.0 ? noise.common_temperature_K() * random_.next() : 0.0;
  for (std::size_t i = 0; i < o_.positions.size(); ++i) {
    errors.temperature_K.push_back(common_K + noise.u_temperature_K * random_.next());
  }
  return errors;
}

Result<Eigen::VectorXd> Trials::next() {
  const BarErrors errors = drawn_errors();
  const double alpha_per_K = o_.bar.expansion ? o_.bar.expansion->alpha_per_K : 0.0;
  Eigen::VectorXd U = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(o_.basis.size()));
  Eigen::VectorXd delta_m(3 * std::ssize(O_m_));
  std::vector<std::optional<BarPose>> pose(o_.positions.size());
  for (std::size_t m = 0; m < passes_.size(); ++m) {
    const Result<BarPoints> found = touched(passes_[m]);
    ABBE_TRY(found);
    const PassObservation& pass = o_.passes[m];
    std::optional<BarPose>& of_position = pose[pass.position];
    if (!of_position) {
      of_position = found->pose;
    }
    const double growth = errors.alpha_per_K * (pass.temperature_K - kReferenceTemperature_K) +
                          alpha_per_K * errors.temperature_K[pass.position];
    for (std::size_t i = 0; i < O_m_.size(); ++i) {
      delta_m.segment<3>(3 * static_cast<Eigen::Index>(i)) =
          of_position->axes.transpose() * (found->O_m[i] - of_position->origin_m) -
          (1.0 - growth) * O_m_[i];
    }
    delta_m += errors.calibration_m;
    U.noalias() += estimator_.of_pass[m] * delta_m;
  }
  return U;
}

void set_ratios(MonteCarlo& result, const Eigen::MatrixXd& covariance) {
  // A smaller u is rounding: the datum fixes this parameter.
  constexpr double kNone = 1e-15;
  std::size_t count = 0;
  result.smallest_ratio = std::numeric_limits<double>::infinity();
  for (Eigen::Index i = 0; i < covariance.rows(); ++i) {
    const double u = std::sqrt(std::max(0.0, covariance(i, i)));
    if (u < kNone) {
      continue;
    }
    const double ratio = result.standard_deviation(i) / u;
    result.mean_ratio += ratio;
    result.smallest_ratio = std::min(result.smallest_ratio, ratio);
    result.largest_ratio = std::max(result.largest_ratio, ratio);
    ++count;
  }
  result.mean_ratio /= static_cast<double>(std::max<std::size_t>(count, 1));
}

Result<Trials> trials_of(const Observations& o, const Solution& solution,
                         const SolveOptions& options, std::uint64_t seed) {
  const std::vector<NominalTouch> touches = nominal_touches(o.bar.pattern, o.plan.tip_radius_m);
  Result<LinearEstimator> estimator = linear_estimator(o, options);
  ABBE_TRY(estimator);
  return nominal_points(o, touches).map([&](std::vector<Vector3> O_m) {
    Trials trials(o, *std::move(estimator), std::move(O_m), seed);
    for (const PassObservation& pass : o.passes) {
      trials.add_pass(simulated_pass(o, pass, touches, solution.U));
    }
    return trials;
  });
}

}  // namespace

Result<MonteCarlo> monte_carlo(const Observations& o, const Solution& solution,
                               const SolveOptions& options, const MonteCarloOptions& trial) {
  if (trial.trials < 2) {
    return failure(ErrorCode::BadInput,
                   message("Monte Carlo: ", trial.trials, " trials, at least 2 are needed"));
  }
  Result<Trials> trials = trials_of(o, solution, options, trial.seed);
  ABBE_TRY(trials);

  const auto count = static_cast<double>(trial.trials);
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(solution.U.size()), squares = sum;
  for (std::size_t i = 0; i < trial.trials; ++i) {
    const Result<Eigen::VectorXd> U = trials->next();
    ABBE_TRY(U);
    const Eigen::VectorXd off = *U - solution.U;
    sum += off;
    squares += off.cwiseAbs2();
    if (trial.progress) {
      trial.progress(static_cast<double>(i + 1) / count);
    }
  }

  MonteCarlo result{.trials = trial.trials, .seed = trial.seed};
  result.mean_error = sum / count;
  result.standard_deviation =
      ((squares - count * result.mean_error.cwiseAbs2()) / (count - 1.0)).cwiseMax(0.0).cwiseSqrt();
  result.scatter_of_ratio = 1.0 / std::sqrt(2.0 * (count - 1.0));
  set_ratios(result, solution.covariance);
  return result;
}

}  // namespace abbe::calib::mfb
