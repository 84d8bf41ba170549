#include "plan/plan_walk.hpp"

#include <algorithm>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "abbe/calib/internal/base/check_stopped.hpp"
#include "abbe/result/try.hpp"
#include "plan/plan_lattice.hpp"

namespace abbe::calib::otf {
namespace {

/// The legs that the walk has already driven, as pairs of lattice points without direction.
class DrivenLegs {
 public:
  void add(std::size_t a, std::size_t b) { legs_.insert(std::minmax(a, b)); }
  [[nodiscard]] bool contains(std::size_t a, std::size_t b) const {
    return legs_.contains(std::minmax(a, b));
  }

 private:
  std::set<std::pair<std::size_t, std::size_t>> legs_;
};

struct NextLeg {
  std::size_t to = 0;
  Leg leg;
  std::size_t points = 0;
  double most_gain = 0.0;  ///< upper bound of the gain per length
};

/// Legs from lattice point `at` that fit the budget, the one with the largest upper bound first.
std::vector<NextLeg> candidates(const PlanProblem& problem, std::span<const Vector3> lattice,
                                std::size_t at, const DrivenLegs& driven, double most_m,
                                const PathState& state) {
  std::vector<NextLeg> next;
  for (std::size_t to = 0; to < lattice.size(); ++to) {
    NextLeg candidate{.to = to, .leg = {lattice[at], lattice[to]}};
    if (to == at || driven.contains(at, to) || candidate.leg.length_m() > most_m) {
      continue;
    }
    candidate.points = problem.points_of(candidate.leg, PlanProblem::kCoarseSpacing_m);
    if (candidate.points > 0) {
      candidate.most_gain =
          problem.trace_with(state.D, candidate.leg, candidate.points) / candidate.leg.length_m();
      next.push_back(candidate);
    }
  }
  std::stable_sort(next.begin(), next.end(),
                   [](const NextLeg& a, const NextLeg& b) { return a.most_gain > b.most_gain; });
  return next;
}

/// The leg with the largest gain. Since (I + W)^-1 <= I, the linear gain is an upper bound of the
/// gain: most legs can be excluded without a decomposition.
std::optional<NextLeg> best_of(const PlanProblem& problem, const std::vector<NextLeg>& next,
                               const PathState& state) {
  std::optional<NextLeg> best;
  double best_gain = 0.0;
  for (const NextLeg& candidate : next) {
    if (best && candidate.most_gain <= best_gain) {
      break;
    }
    const double gain =
        problem.gain(state, candidate.leg, candidate.points) / candidate.leg.length_m();
    if (!best || gain > best_gain) {
      best = candidate;
      best_gain = gain;
    }
  }
  return best;
}

}  // namespace

Result<Path> greedy_walk(const PlanProblem& problem, std::span<const Vector3> lattice,
                         const PathBudget& budget, const RelaxedDesign& rest,
                         const Stopped& stopped) {
  const double whole_m = walk_length_m(budget, problem.run().drive, rest.mean_leg_m);
  Path path{{lattice.front()}};
  DrivenLegs driven;
  Eigen::MatrixXd H = problem.prior();
  std::size_t at = 0;
  double driven_m = 0.0;

  while (true) {
    ABBE_TRY(check_stopped(stopped));

    const double left_m = std::max(whole_m - driven_m, 0.0);
    const double most_m =
        longest_path_m(budget, problem.run().drive, path.vertices_m.size()) - driven_m;
    const PathState state =
        problem.with_slope(problem.state_of(Eigen::MatrixXd(H + left_m * rest.H_per_m)));
    const std::optional<NextLeg> next =
        best_of(problem, candidates(problem, lattice, at, driven, most_m, state), state);
    if (!next) {
      return path;
    }

    driven.add(at, next->to);
    at = next->to;
    driven_m += next->leg.length_m();
    path.vertices_m.push_back(lattice[at]);
    problem.add(next->leg, 1.0, H);
  }
}

}  // namespace abbe::calib::otf
