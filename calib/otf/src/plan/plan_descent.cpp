#include "plan/plan_descent.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "abbe/calib/internal/base/check_stopped.hpp"
#include "abbe/calib/otf/run/polyline.hpp"
#include "abbe/result/try.hpp"
#include "plan/is_enough.hpp"

namespace abbe::calib::otf {
namespace {

/// One vector for each vertex.
using VertexVectors = std::vector<Vector3>;

double dot(const VertexVectors& a, const VertexVectors& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    sum += a[i].dot(b[i]);
  }
  return sum;
}

double largest_entry(const VertexVectors& v) {
  double most = 0.0;
  for (const Vector3& x : v) {
    most = std::max(most, x.cwiseAbs().maxCoeff());
  }
  return most;
}

/// Derivative of trace(H_leg D) by a movement of one end of the leg along coordinate k, to the side
/// `sign` (+1 or -1).
double derivative(const PlanProblem& problem, const Eigen::MatrixXd& D, Leg leg, bool at_end,
                  Eigen::Index k, double sign, double value) {
  // At this step the rounding of the value (1e-12) and the curvature (1/m) change the derivative by
  // much less than 1e-4.
  constexpr double kStep_m = 1e-7;
  const std::size_t points = problem.points_of(leg);
  (at_end ? leg.to_m : leg.from_m)[k] += sign * kStep_m;
  return (problem.trace_with(D, leg, points) - value) / kStep_m;
}

/// Direction of descent of trace(G C): for each coordinate of a vertex the side on which the value
/// decreases more, with its slope; zero if the value increases on both sides. The slopes on both
/// sides differ if a leg lies in a plane of nodes.
VertexVectors descent(const PlanProblem& problem, const PathState& state, const Path& path) {
  VertexVectors up(path.vertices_m.size(), Vector3::Zero()), down = up;
  for (std::size_t i = 0; i + 1 < path.vertices_m.size(); ++i) {
    const Leg leg{path.vertices_m[i], path.vertices_m[i + 1]};
    const double value = problem.trace_with(state.D, leg, problem.points_of(leg));
    for (Eigen::Index k = 0; k < 3; ++k) {
      up[i][k] += derivative(problem, state.D, leg, false, k, 1.0, value);
      up[i + 1][k] += derivative(problem, state.D, leg, true, k, 1.0, value);
      down[i][k] += derivative(problem, state.D, leg, false, k, -1.0, value);
      down[i + 1][k] += derivative(problem, state.D, leg, true, k, -1.0, value);
    }
  }

  VertexVectors step(up.size());
  for (std::size_t i = 0; i < step.size(); ++i) {
    for (Eigen::Index k = 0; k < 3; ++k) {
      const double most = std::max({up[i][k], down[i][k], 0.0});
      step[i][k] = up[i][k] >= down[i][k] ? most : -most;
    }
  }
  return step;
}

VertexVectors gradient_of_length(const Path& path) {
  VertexVectors g(path.vertices_m.size(), Vector3::Zero());
  for (std::size_t i = 0; i + 1 < path.vertices_m.size(); ++i) {
    const Vector3 direction = (path.vertices_m[i + 1] - path.vertices_m[i]).normalized();
    g[i] -= direction;
    g[i + 1] += direction;
  }
  return g;
}

/// Box of the travel of the axes.
struct TravelBox {
  Vector3 low_m, high_m;
};

TravelBox box_of(const MachineNodes& nodes) {
  TravelBox box;
  for (const Axis a : kAllAxes) {
    const auto k = static_cast<Eigen::Index>(index(a));
    box.low_m[k] = nodes[index(a)].nodes_m.front();
    box.high_m[k] = nodes[index(a)].nodes_m.back();
  }
  return box;
}

/// Sets components of the step to zero that would move fixed vertices, or move vertices out of the
/// box.
void keep_inside(VertexVectors& step, const Path& path, const std::vector<bool>& fixed,
                 const TravelBox& box) {
  for (std::size_t i = 0; i < step.size(); ++i) {
    for (Eigen::Index k = 0; k < 3; ++k) {
      const double q = path.vertices_m[i][k];
      if (fixed[i] || (q <= box.low_m[k] && step[i][k] < 0.0) ||
          (q >= box.high_m[k] && step[i][k] > 0.0)) {
        step[i][k] = 0.0;
      }
    }
  }
}

Path moved(const Path& path, const VertexVectors& step, double factor, const TravelBox& box) {
  Path to = path;
  for (std::size_t i = 0; i < step.size(); ++i) {
    to.vertices_m[i] =
        (path.vertices_m[i] + factor * step[i]).cwiseMax(box.low_m).cwiseMin(box.high_m);
  }
  return to;
}

/// Shortens the path to `most_m` along the gradient of its length.
Path shortened(Path path, const std::vector<bool>& fixed, double most_m, const TravelBox& box) {
  constexpr int kMostSteps = 20;
  for (int i = 0; i < kMostSteps; ++i) {
    const double excess_m = lengths_to_vertices_m(path).back() - most_m;
    if (excess_m <= 0.0) {
      break;
    }
    VertexVectors step = gradient_of_length(path);
    for (Vector3& s : step) {
      s = -s;
    }
    keep_inside(step, path, fixed, box);
    const double squares = dot(step, step);
    if (!(squares > 0.0)) {
      break;
    }
    path = moved(path, step, excess_m * (1.0 + 1e-9) / squares, box);
  }
  return path;
}

/// Removes the component of the step that makes the path longer.
void keep_length(VertexVectors& step, const Path& path, const std::vector<bool>& fixed,
                 const TravelBox& box) {
  VertexVectors l = gradient_of_length(path);
  for (std::size_t i = 0; i < l.size(); ++i) {
    for (Eigen::Index k = 0; k < 3; ++k) {
      if (step[i][k] == 0.0) {
        l[i][k] = 0.0;
      }
    }
  }
  const double squares = dot(l, l), longer = dot(step, l);
  if (squares > 0.0 && longer > 0.0) {
    for (std::size_t i = 0; i < step.size(); ++i) {
      step[i] -= longer / squares * l[i];
    }
  }
  keep_inside(step, path, fixed, box);
}

}  // namespace

Result<Path> descend(const PlanProblem& problem, Path path, const std::vector<bool>& fixed,
                     double most_m, std::size_t most_steps, const PlanOptions& options) {
  // Largest movement of a vertex in one step: at the beginning, and its limits.
  constexpr double kFirst_m = 0.01, kLargest_m = 0.05, kLeast_m = 0.2e-3;
  const TravelBox box = box_of(problem.run().machine.nodes);
  path = shortened(std::move(path), fixed, most_m, box);
  PathState state = problem.state_of(path);
  double move_m = kFirst_m;

  for (std::size_t i = 0; i < most_steps && move_m >= kLeast_m; ++i) {
    if (is_enough(options)) {
      break;
    }
    ABBE_TRY(check_stopped(options.stopped));

    state = problem.with_slope(std::move(state));
    VertexVectors step = descent(problem, state, path);
    keep_inside(step, path, fixed, box);
    if (lengths_to_vertices_m(path).back() >= (1.0 - 1e-6) * most_m) {
      keep_length(step, path, fixed, box);
    }
    const double largest = largest_entry(step);
    if (!(largest > 0.0)) {
      break;
    }

    while (move_m >= kLeast_m) {
      Path to = shortened(moved(path, step, move_m / largest, box), fixed, most_m, box);
      PathState there = problem.state_of(to);
      if (there.value_m2 < state.value_m2 && lengths_to_vertices_m(to).back() <= most_m) {
        path = std::move(to);
        state = std::move(there);
        move_m = std::min(1.5 * move_m, kLargest_m);
        break;
      }
      move_m *= 0.4;
    }
  }

  return path;
}

}  // namespace abbe::calib::otf
