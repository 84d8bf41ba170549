#include "plan/plan_relaxation.hpp"

#include <cmath>
#include <utility>
#include <vector>

#include "abbe/calib/internal/base/check_stopped.hpp"
#include "abbe/result/try.hpp"

namespace abbe::calib::otf {
namespace {

/// A leg with the number of times it is driven (`weight`, need not be an integer).
struct WeightedLeg {
  Leg leg;
  double length_m = 0.0;
  double weight = 0.0;
};

/// All legs between lattice points, with the same weight.
std::vector<WeightedLeg> all_legs(const PlanProblem& problem, std::span<const Vector3> lattice,
                                  double length_m) {
  std::vector<WeightedLeg> legs;
  double sum_m = 0.0;
  for (std::size_t i = 0; i < lattice.size(); ++i) {
    for (std::size_t k = i + 1; k < lattice.size(); ++k) {
      const Leg leg{lattice[i], lattice[k]};
      if (problem.points_of(leg) > 0) {
        legs.push_back({leg, leg.length_m(), 1.0});
        sum_m += legs.back().length_m;
      }
    }
  }
  for (WeightedLeg& l : legs) {
    l.weight = length_m / sum_m;
  }
  return legs;
}

Eigen::MatrixXd information_of_legs(const PlanProblem& problem,
                                    const std::vector<WeightedLeg>& legs) {
  const Eigen::Index n = problem.G().rows();
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(n, n);
  for (const WeightedLeg& l : legs) {
    problem.add(l.leg, l.weight, H, PlanProblem::kCoarseSpacing_m);
  }
  return H;
}

/// One step of the multiplicative algorithm. Legs with a negligible weight are removed.
void reweight(const PlanProblem& problem, const PathState& state, double length_m, double least,
              std::vector<WeightedLeg>& legs) {
  double sum_m = 0.0;
  for (WeightedLeg& l : legs) {
    const double worth =
        problem.trace_with(state.D, l.leg,
                           problem.points_of(l.leg, PlanProblem::kCoarseSpacing_m)) /
        l.length_m / (state.value_m2 / length_m);
    // The power 3/4 converges faster than 1/2 and does not oscillate as 1 does.
    l.weight *= std::sqrt(worth * std::sqrt(worth));
    sum_m += l.weight * l.length_m;
  }

  for (WeightedLeg& l : legs) {
    l.weight *= length_m / sum_m;
  }
  std::erase_if(legs, [least](const WeightedLeg& l) { return l.weight < least; });
}

}  // namespace

Result<RelaxedDesign> relaxed_design(const PlanProblem& problem, std::span<const Vector3> lattice,
                                     double length_m, const Stopped& stopped) {
  constexpr int kSteps = 25;
  constexpr double kNegligible = 0.02;
  std::vector<WeightedLeg> legs = all_legs(problem, lattice, length_m);
  const double least = kNegligible * legs.front().weight;
  Eigen::MatrixXd H = information_of_legs(problem, legs);
  PathState state = problem.state_of(Eigen::MatrixXd(problem.prior() + H));

  for (int i = 0; i < kSteps; ++i) {
    ABBE_TRY(check_stopped(stopped));
    state = problem.with_slope(std::move(state));
    reweight(problem, state, length_m, least, legs);
    H = information_of_legs(problem, legs);
    state = problem.state_of(Eigen::MatrixXd(problem.prior() + H));
  }

  double count = 0.0;
  for (const WeightedLeg& l : legs) {
    count += l.weight;
  }
  return RelaxedDesign{H / length_m, length_m / count, state.value_m2};
}

}  // namespace abbe::calib::otf
