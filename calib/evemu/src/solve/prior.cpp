#include "abbe/calib/evemu/solve/prior.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/statistics/elementary.hpp"
#include "solve/most_likely_near.hpp"

namespace abbe::calib::evemu {
namespace {

/// Natural logarithms of the hyper-parameters s_d, rho, s_a, s, w (prior.hpp).
using Theta = Eigen::Matrix<double, 5, 1>;
using Theta5x5 = Eigen::Matrix<double, 5, 5>;
constexpr Eigen::Index kSd = 0, kRho = 1, kSa = 2, kS = 3, kW = 4;

HyperParameters parameters(const Theta& theta) {
  return {.s_d_m = exponential(theta(kSd)),
          .rho = exponential(theta(kRho)),
          .s_a_m = exponential(theta(kSa)),
          .s_m = exponential(theta(kS)),
          .w_rad = exponential(theta(kW))};
}

Theta logarithms(const HyperParameters& h) {
  Theta theta;
  theta << natural_logarithm(h.s_d_m), natural_logarithm(h.rho), natural_logarithm(h.s_a_m),
      natural_logarithm(h.s_m), natural_logarithm(h.w_rad);
  return theta;
}

struct Bounds {
  Theta low, high;
};
const Bounds& bounds() {
  static const Bounds b{logarithms({1e-7, 1e-3, 1e-7, 1e-9, 1e-8}),
                        logarithms({1.0, 3.0, 1.0, 1e-3, 1e-2})};
  return b;
}

/// True for the scale error of an axis: the linear translation along the axis itself.
bool is_scale(const DesignFunction& f) {
  return f.kind == FunctionKind::Translation && f.order == 1 && f.part[0].component == f.axis;
}

/// Lower limit of s_d in the prior of a linear translation.
double least_s_d_m(const DesignFunction& f, const ScaledDesign& design) {
  return is_scale(f) ? kScalePrior * design.arm_unit_m() : kLinearPrior_m;
}

/// Prior variance of a scale error without the part s_a^2 of rotations [m^2].
double own_scale_variance_m2(const DesignFunction& f, const ScaledDesign& design, double s_d_m) {
  const double half_m = design.box().half_width_m(static_cast<Eigen::Index>(f.axis));
  const double sd_m = std::max(s_d_m, least_s_d_m(f, design)) * half_m / design.arm_unit_m();
  return sd_m * sd_m;
}

/// d log(prior variance) / d theta of one column, theta: logarithms of the hyper-parameters. `f`:
/// the design function of the column; null: the column is a pose rotation.
Theta sensitivity(PriorKind kind, const DesignFunction* f, const ScaledDesign& design,
                  const HyperParameters& h) {
  Theta d = Theta::Zero();
  if (f == nullptr) {
    d(kW) = kind == PriorKind::BayesPose ? 2.0 : 0.0;
  } else if (f->kind == FunctionKind::Constant) {
    return d;
  } else if (kind == PriorKind::Ridge) {
    d(kSd) = 2.0;
  } else if (f->kind == FunctionKind::Rotation) {
    d(kSa) = 2.0;
    d(kRho) = 2.0 * (f->order - 1);
  } else if (is_scale(*f)) {
    const double own_m2 = own_scale_variance_m2(*f, design, h.s_d_m), abbe_m2 = h.s_a_m * h.s_a_m;
    d(kSd) = h.s_d_m > least_s_d_m(*f, design) ? 2.0 * own_m2 / (own_m2 + abbe_m2) : 0.0;
    d(kSa) = 2.0 * abbe_m2 / (own_m2 + abbe_m2);
  } else if (f->order > 1 || h.s_d_m > least_s_d_m(*f, design)) {
    d(kSd) = 2.0;
    d(kRho) = 2.0 * (f->order - 1);
  }

  return d;
}

/// Function to be minimised: minus log likelihood, with gradient.
struct Objective {
  PriorKind kind;
  const ScaledDesign& design;
  std::size_t positions;
  const LinearGaussian& problem;
  std::span<const double> added;
  int evaluations = 0;

  double operator()(const Theta& theta, Theta& gradient) {
    ++evaluations;
    const HyperParameters h = parameters(theta);
    const Eigen::VectorXd prior =
        with_added(prior_variances(kind, design, positions, h), design.size(), added);
    const LinearGaussian::Evidence e = problem.evidence(prior, h.s_m * h.s_m);
    gradient.setZero();

    for (Eigen::Index j = 0; j < e.by_log_prior.size(); ++j) {
      const auto column = static_cast<std::size_t>(j);
      if (column >= design.size() && column < design.size() + added.size()) {
        continue;  // its prior variance is known
      }
      const DesignFunction* f = column < design.size() ? &design.functions()[column] : nullptr;
      gradient -= e.by_log_prior(j) * sensitivity(kind, f, design, h);
    }

    gradient(kS) -= 2.0 * e.by_log_noise;
    return -e.log_likelihood;
  }
};

/// Sets the components of a search direction to zero along which theta would leave its bounds or
/// change a fixed parameter.
void keep_inside(const Theta& theta, const Theta& gradient, std::optional<Eigen::Index> fixed,
                 Theta& direction) {
  if (fixed) {
    direction(*fixed) = 0.0;
  }
  for (Eigen::Index i = 0; i < theta.size(); ++i) {
    const bool at_low = theta(i) <= bounds().low(i) && gradient(i) > 0;
    const bool at_high = theta(i) >= bounds().high(i) && gradient(i) < 0;
    if (at_low || at_high) {
      direction(i) = 0.0;
    }
  }
}

struct Minimum {
  Theta theta;
  double value = std::numeric_limits<double>::infinity();
};

/// BFGS with backtracking, steps of at most a factor e^2 in any parameter. `fixed`: a parameter
/// that keeps its starting value.
Minimum descend(Objective& f, const Theta& start, std::optional<Eigen::Index> fixed = {}) {
  constexpr int kMostIterations = 60;
  // The search ends where no component of the gradient of the log likelihood by theta (logarithms
  // of the parameters) exceeds this: far below a significant difference.
  constexpr double kFlat = 1e-4;
  Minimum at{start};
  Theta gradient;
  at.value = f(at.theta, gradient);
  Theta5x5 inverse_hessian = 0.05 * Theta5x5::Identity();

  for (int iteration = 0; iteration < kMostIterations; ++iteration) {
    Theta free = gradient;
    keep_inside(at.theta, gradient, fixed, free);
    if (free.cwiseAbs().maxCoeff() < kFlat) {
      break;
    }
    Theta direction = -inverse_hessian * free;
    keep_inside(at.theta, gradient, fixed, direction);
    if (!(direction.dot(free) < 0.0)) {
      inverse_hessian = 0.05 * Theta5x5::Identity();
      direction = -0.05 * free;
    }
    constexpr double kLongest = 2.0;
    direction *= std::min(1.0, kLongest / direction.cwiseAbs().maxCoeff());
    double step = 1.0;
    Theta next, next_gradient;
    double value = 0.0;
    bool lower = false;
    for (int halving = 0; halving < 12 && !lower; ++halving, step *= 0.4) {
      next = (at.theta + step * direction).cwiseMax(bounds().low).cwiseMin(bounds().high);
      value = f(next, next_gradient);
      lower = value < at.value + 1e-4 * free.dot(next - at.theta);
    }
    if (!lower) {
      break;
    }
    const Theta s = next - at.theta, y = next_gradient - gradient;
    const double gain = at.value - value, sy = s.dot(y);
    if (sy > 1e-10 * s.norm() * y.norm()) {
      const Theta5x5 left = Theta5x5::Identity() - s * y.transpose() / sy;
      inverse_hessian = left * inverse_hessian * left.transpose() + s * s.transpose() / sy;
    }
    at = {next, value};
    gradient = next_gradient;
    constexpr double kSettled = 1e-7;
    if (gain < kSettled) {
      break;
    }
  }

  return at;
}

/// Changes one parameter in steps away from `from`, estimates the others again after each step, and
/// adds the parameters to `comparable`, as long as the data hardly distinguish them from `from`.
void follow(Objective& f, const Minimum& from, Eigen::Index along, double step,
            std::vector<HyperParameters>& comparable) {
  constexpr int kMostSteps = 8;
  Theta at = from.theta;

  for (int i = 0; i < kMostSteps; ++i) {
    at(along) += step;
    if (at(along) < bounds().low(along) || at(along) > bounds().high(along)) {
      return;
    }
    const Minimum next = descend(f, at, along);
    if (!(next.value <= from.value + kComparable)) {
      return;
    }
    comparable.push_back(parameters(next.theta));
    at = next.theta;
  }
}

}  // namespace

Eigen::VectorXd prior_variances(PriorKind kind, const ScaledDesign& design, std::size_t positions,
                                const HyperParameters& h) {
  const auto n = static_cast<Eigen::Index>(design.size());
  Eigen::VectorXd v(n + static_cast<Eigen::Index>(3 * positions));
  for (std::size_t j = 0; j < design.size(); ++j) {
    const DesignFunction& f = design.functions()[j];
    double sd_m = h.s_d_m;
    if (f.kind == FunctionKind::Constant) {
      sd_m = kConstantPrior_m;
    } else if (kind == PriorKind::BayesPose) {
      sd_m = (f.kind == FunctionKind::Rotation ? h.s_a_m : h.s_d_m) * power(h.rho, f.order - 1);
      if (f.kind == FunctionKind::Translation && f.order == 1) {
        sd_m = is_scale(f)
                   ? std::sqrt(own_scale_variance_m2(f, design, h.s_d_m) + h.s_a_m * h.s_a_m)
                   : std::max(sd_m, least_s_d_m(f, design));
      }
    }

    v(static_cast<Eigen::Index>(j)) = sd_m * sd_m;
  }

  v.tail(v.size() - n).setConstant(kind == PriorKind::BayesPose ? h.w_rad * h.w_rad : 0.0);
  return v;
}

Eigen::VectorXd with_added(const Eigen::VectorXd& variances, std::size_t design_size,
                           std::span<const double> added) {
  const auto n = static_cast<Eigen::Index>(design_size),
             k = static_cast<Eigen::Index>(added.size());
  Eigen::VectorXd all(variances.size() + k);
  all << variances.head(n), Eigen::Map<const Eigen::VectorXd>(added.data(), k),
      variances.tail(variances.size() - n);
  return all;
}

Result<HyperParameters> most_likely(PriorKind kind, const ScaledDesign& design,
                                    std::size_t positions, const LinearGaussian& problem,
                                    std::span<const double> added) {
  Objective f{kind, design, positions, problem, added};
  // The likelihood can have several maxima, with noise or with pose rotations as the origin of the
  // scatter. With a flat array one maximum attributes noise to the scale of the axis perpendicular
  // to the array (large s_d, small rho), another one belongs to an accurate machine.
  const std::array<HyperParameters, 4> starts{
      HyperParameters{.s_d_m = 5e-4, .rho = 0.6, .s_a_m = 5e-4, .s_m = 1e-5, .w_rad = 1e-4},
      HyperParameters{.s_d_m = 5e-4, .rho = 0.6, .s_a_m = 5e-4, .s_m = 5e-6, .w_rad = 2e-6},
      HyperParameters{.s_d_m = 3e-4, .rho = 0.45, .s_a_m = 2e-4, .s_m = 8e-6, .w_rad = 3e-4},
      HyperParameters{.s_d_m = 1e-5, .rho = 0.45, .s_a_m = 1e-5, .s_m = 3e-6, .w_rad = 1e-5}};
  Minimum best{logarithms(starts.front())};
  const std::size_t used = kind == PriorKind::Ridge ? 1 : starts.size();

  for (std::size_t i = 0; i < used; ++i) {
    const Minimum found = descend(f, logarithms(starts[i]));
    if (found.value < best.value) {
      best = found;
    }
  }

  if (!std::isfinite(best.value)) {
    return failure(ErrorCode::NotConverged,
                   message("bayes: none of ", used, " starting points has a likelihood"));
  }

  HyperParameters h = parameters(best.theta);
  if (kind == PriorKind::Ridge) {
    h.rho = 1.0;
    h.s_a_m = h.s_d_m;
    h.w_rad = 0.0;
  }

  h.log_likelihood = -best.value;
  h.evaluations = f.evaluations;
  return h;
}

std::vector<HyperParameters> comparable_parameters(const HyperParameters& most_likely,
                                                   const ScaledDesign& design,
                                                   std::size_t positions,
                                                   const LinearGaussian& problem) {
  Objective f{PriorKind::BayesPose, design, positions, problem, {}};
  const Minimum highest{logarithms(most_likely), -most_likely.log_likelihood};
  const double factor_2 = natural_logarithm(2.0);
  std::vector<HyperParameters> comparable;

  for (const Eigen::Index along : {kSd, kRho, kSa, kW}) {
    follow(f, highest, along, factor_2, comparable);
    follow(f, highest, along, -factor_2, comparable);
  }

  return comparable;
}

Result<HyperParameters> most_likely_near(const HyperParameters& start, const ScaledDesign& design,
                                         std::size_t positions, const LinearGaussian& problem,
                                         std::span<const double> added) {
  Objective f{PriorKind::BayesPose, design, positions, problem, added};
  const Minimum found = descend(f, logarithms(start));
  if (!std::isfinite(found.value)) {
    return failure(ErrorCode::NotConverged,
                   "bayes: the likelihood near the estimate cannot be computed");
  }
  HyperParameters h = parameters(found.theta);
  h.log_likelihood = -found.value;
  h.evaluations = f.evaluations;
  return h;
}

}  // namespace abbe::calib::evemu
