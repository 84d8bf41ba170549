#include "abbe/calib/otf/plan/plan.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/otf/plan/plan_observable.hpp"
#include "abbe/calib/otf/run/polyline.hpp"
#include "abbe/result/try.hpp"
#include "plan/is_enough.hpp"
#include "plan/plan_descent.hpp"
#include "plan/plan_exchange.hpp"
#include "plan/plan_lattice.hpp"
#include "plan/plan_walk.hpp"

namespace abbe::calib::otf {
namespace {

Result<void> check_budget(const PathBudget& budget, const PlanOptions& options) {
  if (!(budget.length_m > 0.0) || !(budget.duration_s > 0.0)) {
    return failure(ErrorCode::BadInput, message("plan: a path of ", budget.length_m, " m and ",
                                                budget.duration_s, " s: must be positive"));
  }
  if (!std::isfinite(budget.length_m) && !std::isfinite(budget.duration_s)) {
    return failure(ErrorCode::BadInput, "plan: neither a length nor a duration of the path");
  }
  if (options.lattice < 3 || options.lattice > 7) {
    return failure(ErrorCode::BadInput,
                   message("plan: ", options.lattice, " lattice points per axis, limits 3 to 7"));
  }
  return {};
}

/// True if a run along the path can be aligned and identified.
bool is_sufficient(const Path& path, const PlannedRun& run) {
  return check(path) && check_observable(path, run.machine, run.backlash);
}

Result<Path> walk(const PlanProblem& problem, std::span<const Vector3> lattice,
                  const PathBudget& budget, const PlanOptions& options) {
  constexpr double kUsualLeg_m = 0.4;
  const double length_m = walk_length_m(budget, problem.run().drive, kUsualLeg_m);
  return relaxed_design(problem, lattice, length_m, options.stopped)
      .and_then([&](const RelaxedDesign& rest) {
        return greedy_walk(problem, lattice, budget, rest, options.stopped);
      });
}

/// Returns the BadInput for a budget that is too short. The text contains the length that a walk on
/// this lattice needs to determine the model.
Result<Path> too_short(const PlanProblem& problem, std::span<const Vector3> lattice,
                       const PlanOptions& options, double walked_m) {
  PathBudget more{.length_m = std::max(walked_m, 1.0)};
  constexpr int kDoublings = 6;
  for (int i = 0; i < kDoublings; ++i) {
    more.length_m *= 2.0;
    Result<Path> path = walk(problem, lattice, more, options);
    if (!path) {
      return path;
    }
    if (!is_sufficient(*path, problem.run())) {
      continue;
    }
    while (path->vertices_m.size() > 3) {
      Path shorter = *path;
      shorter.vertices_m.pop_back();
      if (!is_sufficient(shorter, problem.run())) {
        break;
      }
      *path = std::move(shorter);
    }
    return failure(ErrorCode::BadInput,
                   message("plan: the budget is too short: it allows ", walked_m,
                           " m; a path that determines the model needs about ",
                           lengths_to_vertices_m(*path).back(), " m, which take ",
                           duration_s(*path, problem.run().drive), " s"));
  }
  return failure(ErrorCode::BadInput, message("plan: the budget is too short: ", walked_m, " m"));
}

/// Rounds the vertices to multiples of 0.1 mm inside the travel, or to its ends. They then have the
/// same bits as numbers in mm that were read from a file.
Path rounded(Path path, const MachineNodes& nodes) {
  constexpr double kPerMm = 10.0, kMmPerM = 1e3;
  for (Vector3& q : path.vertices_m) {
    for (Eigen::Index k = 0; k < 3; ++k) {
      const std::vector<double>& nodes_m = nodes[static_cast<std::size_t>(k)].nodes_m;
      if (q[k] != nodes_m.front() && q[k] != nodes_m.back()) {
        const double rounded_m = std::round(kPerMm * kMmPerM * q[k]) / kPerMm / kMmPerM;
        q[k] = std::clamp(rounded_m, nodes_m.front(), nodes_m.back());
      }
    }
  }
  return path;
}

std::size_t corners_reached(const Path& path, const MachineNodes& nodes) {
  const std::vector<bool> fixed = fixed_vertices(path, nodes);
  return static_cast<std::size_t>(std::count(fixed.begin(), fixed.end(), true));
}

/// Longest permitted path before its vertices are rounded; rounding may make it longer by 0.1 mm
/// per leg.
double most_before_rounding_m(const PathBudget& budget, const Drive& drive, std::size_t legs) {
  constexpr double kPerLeg_m = 0.1e-3;
  return longest_path_m(budget, drive, legs) - kPerLeg_m * static_cast<double>(legs);
}

/// Improves the path by exchange and descent (plan.hpp).
Result<Path> improved(const PlanProblem& problem, Path path, std::span<const Vector3> lattice,
                      const PathBudget& budget, const PlanOptions& options) {
  constexpr std::size_t kSteps = 40;
  const PlannedRun& run = problem.run();
  return exchange_vertices(problem, std::move(path), lattice, budget, options)
      .and_then([&](const Path& exchanged) {
        const double most_m =
            most_before_rounding_m(budget, run.drive, exchanged.vertices_m.size() - 1);
        return descend(problem, exchanged, fixed_vertices(exchanged, run.machine.nodes), most_m,
                       kSteps, options);
      });
}

}  // namespace

Result<PlannedPath> plan(const PlannedRun& run, const PathBudget& budget,
                         const PlanOptions& options) {
  Result<void> valid = check(run);
  if (valid) {
    valid = check_budget(budget, options);
  }
  const Result<ParameterLayout> layout =
      ParameterLayout::observable_with_one_target(run.machine.chain, run.machine.nodes);
  if (!valid || !layout) {
    return tl::unexpected(valid ? layout.error() : valid.error());
  }

  const PlanProblem problem(run, *layout);
  const MachineNodes& nodes = run.machine.nodes;
  const std::vector<Vector3> lattice = plan_lattice(nodes, options.lattice);
  Result<Path> path = walk(problem, lattice, budget, options);
  ABBE_TRY(path);

  *path = reach_corners(problem, *std::move(path), budget);
  const double walk_value = problem.state_of(*path).value_m2;
  bool ended_early = false;
  if (options.exchanges > 0) {
    PlanOptions improving = options;
    improving.enough = [&] { return ended_early = ended_early || is_enough(options); };
    path = improved(problem, *std::move(path), lattice, budget, improving);
  }
  ABBE_TRY(path);

  *path = rounded(*std::move(path), nodes);
  if (!is_sufficient(*path, run)) {
    path = too_short(problem, lattice, options, lengths_to_vertices_m(*path).back());
    return tl::unexpected(path.error());
  }

  constexpr std::size_t kCorners = 8;
  return PlannedPath{.path = *path,
                     .walk_rms_u_m = std::sqrt(walk_value),
                     .rms_u_m = std::sqrt(problem.state_of(*path).value_m2),
                     .ended_early = ended_early,
                     .corners_not_reached = kCorners - corners_reached(*path, nodes)};
}

}  // namespace abbe::calib::otf
