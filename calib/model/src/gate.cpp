#include "abbe/calib/model/gate.hpp"

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/model/model_comparison.hpp"

namespace abbe::calib {
namespace {

/// Points at which decide() evaluates V. Tables: the whole grid of nodes(). Polynomials: only
/// inside the validity volume. There the nodes alone are not sufficient, because a thin or tilted
/// hull can pass between them; vertices and midpoints are added.
std::vector<Vector3> evaluation_points(const VolumetricModel& model) {
  std::vector<Vector3> found = tensor_grid(model.nodes());
  if (model.tables() != nullptr) {
    return found;
  }
  std::erase_if(found, [&](const Vector3& q) { return !model.validity().contains(q); });
  const std::span<const Vector3> vertices = model.validity().vertices_m();
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      found.push_back(0.5 * (vertices[i] + vertices[j]));
    }
  }
  return found;
}

/// Largest |V| without the rigid motion that fits best: a rigid motion of V is no error of the
/// machine, and in the datum of a model it can be large where the axes are far from machine zero.
double max_error_m(const VolumetricModel& model, const std::vector<Vector3>& at, const Vector3& t) {
  std::vector<Vector3> points_m, V_m;
  for (const Vector3& q : at) {
    points_m.push_back(q + t);
    V_m.push_back(model.V_at(q, t));
  }
  const Result<ModelDifference> without_motion = rigid_free(points_m, V_m);
  return without_motion ? without_motion->rigid_free.max_m : vector_statistics(V_m).max_m;
}

/// Largest |dV/dq| at the given points from central differences. Exact for polynomials of low
/// order; for order five the relative error is the square of step / extent of the volume.
double max_slope(const VolumetricModel& model, const std::vector<Vector3>& at, const Vector3& t) {
  constexpr double kStep_m = 1e-4;
  double most = 0.0;
  for (const Vector3& q : at) {
    for (int a = 0; a < 3; ++a) {
      const Vector3 step = kStep_m * Vector3::Unit(a);
      most = std::max(most,
                      (model.V_at(q + step, t) - model.V_at(q - step, t)).norm() / (2 * kStep_m));
    }
  }
  return most;
}

/// Largest |dV/dq| of linear tables. V is linear between nodes along an axis and multilinear in the
/// other two axes, so that its derivative is largest on the grid lines.
double max_slope_of_tables(const VolumetricModel& model, const Vector3& t) {
  double most = 0.0;
  const MachineNodes& nodes = model.nodes();
  for (const Vector3& q : tensor_grid(nodes)) {
    for (const Axis a : kAllAxes) {
      const auto k = static_cast<Eigen::Index>(index(a));
      const std::vector<double>& axis = nodes[index(a)].nodes_m;
      const auto next = std::upper_bound(axis.begin(), axis.end(), q(k));
      if (next == axis.end()) {
        continue;
      }
      Vector3 beside = q;
      beside(k) = *next;
      most = std::max(most, (model.V_at(beside, t) - model.V_at(q, t)).norm() / (*next - q(k)));
    }
  }

  return most;
}

Vector3 mean(std::span<const Vector3> points) {
  Vector3 sum = Vector3::Zero();
  for (const Vector3& p : points) {
    sum += p;
  }
  return points.empty() ? sum : Vector3(sum / static_cast<double>(points.size()));
}

/// Points inside the volume: the points of a lattice with 32 cells per axis over its bounding box
/// that are inside. If there are none (a tilted volume thinner than a cell), the midpoints between
/// centre and vertices.
std::vector<Vector3> points_inside(const ValidityVolume& volume) {
  constexpr int kCells = 32;
  const std::span<const Vector3> vertices = volume.vertices_m();
  if (vertices.empty()) {
    return {};
  }

  Vector3 low = vertices.front(), high = low;
  for (const Vector3& v : vertices) {
    low = low.cwiseMin(v);
    high = high.cwiseMax(v);
  }

  std::vector<Vector3> found;
  for (int x = 0; x < kCells; ++x) {
    for (int y = 0; y < kCells; ++y) {
      for (int z = 0; z < kCells; ++z) {
        const Vector3 at = (Vector3(x, y, z).array() + 0.5) / kCells;
        const Vector3 q = low + at.cwiseProduct(high - low);
        if (volume.contains(q)) {
          found.push_back(q);
        }
      }
    }
  }

  if (found.empty()) {
    const Vector3 centre = mean(vertices);
    for (const Vector3& v : vertices) {
      found.push_back(0.5 * (v + centre));
    }
  }

  return found;
}

/// If the new volume contains less than this fraction of the old volume, it counts as smaller. The
/// scatter of the fraction, caused by the readings and the lattice, is smaller than 2 %.
constexpr double kSameVolume = 0.98;

/// Rim at each side of a volume, as a fraction of its width, by which the volumes of two
/// calibrations of one machine typically differ. If a ball array is set up by hand, within 3
/// degrees of its previous orientation, 2.4 to 4.1 % of the volume are lost at the rim.
constexpr double kRim = 0.02;

void compare_volumes(Verdict& verdict, const VolumetricModel& candidate,
                     const VolumetricModel& active, const GateLimits& limits) {
  const double kept = kept_share(active.validity(), candidate.validity());
  if (kept >= kSameVolume) {
    return;
  }

  const std::string seen = message("the model is valid in ", 100 * kept,
                                   " % of the validity volume of the active model");
  if (kept_share(active.validity(), candidate.validity(), kRim) >= kSameVolume) {
    verdict.notes.push_back(
        message(seen, "; the rest is outside by at most ", 100 * kRim, " % of the width"));
  } else if (limits.accept_smaller_volume) {
    verdict.notes.push_back(message(seen, ", explicitly accepted"));
  } else {
    verdict.refuse("volume",
                   message(seen, "; to replace the active model, accept ", kSmallerVolume));
  }
}

struct ScaleDifference {
  double value = 0.0;
  double u = 0.0;  ///< upper bound: the errors at all points are assumed to be fully correlated
};

/// Difference of scale, candidate minus active model, inside both validity volumes.
ScaleDifference scale_difference(const VolumetricModel& candidate, const VolumetricModel& active,
                                 const Vector3& t) {
  constexpr std::size_t kEnough = 1000;
  const std::vector<Vector3> all = points_inside(active.validity());
  std::vector<Vector3> at, difference_m;

  for (std::size_t i = 0; i < all.size(); i += 1 + all.size() / kEnough) {
    if (candidate.validity().contains(all[i])) {
      at.push_back(all[i]);
    }
  }

  const Vector3 centre = mean(at);
  double u_along = 0.0, squares = 0.0;
  for (const Vector3& q : at) {
    const VolumetricError a = candidate.error_at(q, t), b = active.error_at(q, t);
    const Vector3 way = q - centre;
    difference_m.push_back(a.V_m - b.V_m);
    u_along += std::sqrt(std::max(0.0, way.dot((a.cov_V_m2 + b.cov_V_m2) * way)));
    squares += way.squaredNorm();
  }

  return {common_scale(at, difference_m), squares > 0.0 ? u_along / squares : 0.0};
}

/// Compares the scale of the candidate with that of the active model. Residuals do not show a wrong
/// scale of path, ranges or temperature, but the difference between the two models does.
void compare_scales(Verdict& verdict, const VolumetricModel& candidate,
                    const VolumetricModel& active, const GateLimits& limits) {
  const ScaleDifference g = scale_difference(candidate, active, candidate.tool_offsets_m().front());
  constexpr double kCoverage = 2.0;

  // With NaN this condition is false, and the candidate is refused.
  if (std::abs(g.value) <= limits.max_scale_change + kCoverage * g.u) {
    return;
  }

  const std::string seen =
      message("the machine is larger by ", 1e6 * g.value,
              " um/m in all directions than in the active model (standard uncertainty at most ",
              1e6 * g.u, " um/m): wrong scale of the path, of the ranges or of a temperature");

  if (limits.accept_scale_change) {
    verdict.notes.push_back(message(seen, ", explicitly accepted"));
  } else {
    verdict.refuse("scale-change",
                   message(seen, "; if the machine was changed, accept ", kScaleChange));
  }
}

void note_what_was_compared(Verdict& verdict, bool holds_for_tool) {
  const HeldOutFigures& h = verdict.held_out;
  if (!holds_for_tool) {
    verdict.notes.emplace_back(
        "not compared with the active model: it is valid for another tool offset");
  } else if (h.observations_beside_active < h.observations) {
    verdict.notes.push_back(message(
        "compared with the active model on ", h.observations_beside_active, " of ", h.observations,
        " held-out observations: the others are outside its validity volume"));
  }
}

void require_better(Verdict& verdict, double candidate, double other, double min_improvement,
                    const char* than) {
  // With NaN this condition is true, and the candidate is refused.
  if (!(candidate < other * (1.0 - min_improvement))) {
    verdict.refuse(
        "held-out",
        message("held-out residual ", candidate, " sigma is not better than ", other, " sigma ",
                than, min_improvement > 0 ? message(" by ", 100 * min_improvement, " %") : ""));
  }
}

}  // namespace

void Verdict::refuse(std::string_view cause, std::string text) {
  refuse(cause, std::move(text), reasons.size());
}

void Verdict::refuse(std::string_view cause, std::string text, std::size_t before) {
  const auto at = static_cast<std::ptrdiff_t>(before);
  reasons.insert(reasons.begin() + at, std::move(text));
  causes.insert(causes.begin() + at, std::string(cause));
}

double kept_share(const ValidityVolume& before, const ValidityVolume& after, double rim) {
  const std::vector<Vector3> points = points_inside(before);
  if (points.empty()) {
    return 1.0;
  }
  const Vector3 centre = rim > 0.0 ? mean(points_inside(after)) : Vector3::Zero();
  const auto kept = std::count_if(points.begin(), points.end(), [&](const Vector3& q) {
    // Equivalent to scaling `after` about its centre so that each side moves out by `rim` of its
    // width.
    return after.contains(centre + (q - centre) / (1.0 + 2.0 * rim));
  });
  return static_cast<double>(kept) / static_cast<double>(points.size());
}

Verdict decide(const VolumetricModel& candidate, const HeldOutFigures& held_out,
               const GateLimits& limits, const VolumetricModel* active) {
  Verdict verdict;
  verdict.held_out = held_out;
  const Vector3 t = candidate.tool_offsets_m().front();
  const std::vector<Vector3> at = evaluation_points(candidate);
  verdict.max_error_m = max_error_m(candidate, at, t);
  verdict.max_gradient = candidate.linear_between_nodes() ? max_slope_of_tables(candidate, t)
                                                          : max_slope(candidate, at, t);

  if (at.empty()) {
    verdict.refuse("nowhere",
                   "the validity volume contains no point at which to check size and gradient of "
                   "the model");
  }

  if (held_out.observations == 0) {
    verdict.refuse("held-out", "no observation was held out to test the model");
  }

  if (held_out.not_held_out > 0) {
    verdict.notes.push_back(
        message(held_out.not_held_out, " of ", held_out.observations + held_out.not_held_out,
                " observations were not held out: without them the model is not determined"));
  }

  require_better(verdict, held_out.candidate, held_out.no_compensation, limits.min_improvement,
                 "without compensation");
  if (held_out.active) {
    // The held-out figure of the candidate comes from fits to a part of its run, whereas the active
    // model was fitted to all of its own run. On an unchanged machine the active model therefore
    // has the better figure and remains active.
    require_better(verdict, held_out.candidate_beside_active.value_or(held_out.candidate),
                   *held_out.active, limits.min_improvement,
                   "of the active model, so the active model remains valid");
  }

  if (!(verdict.max_error_m <= limits.max_error_m)) {
    verdict.refuse("size",
                   message("largest error, without rigid motion, ", 1e6 * verdict.max_error_m,
                           " um exceeds ", 1e6 * limits.max_error_m, " um"));
  }

  if (!(verdict.max_gradient <= limits.max_gradient)) {
    verdict.refuse("slope", message("steepest change ", 1e6 * verdict.max_gradient,
                                    " um/m exceeds ", 1e6 * limits.max_gradient, " um/m"));
  }

  if (active != nullptr) {
    const bool holds_for_tool = active->holds_for_tool(t);
    note_what_was_compared(verdict, holds_for_tool);
    if (holds_for_tool) {
      compare_volumes(verdict, candidate, *active, limits);
      compare_scales(verdict, candidate, *active, limits);
    }
  }

  verdict.accepted = verdict.reasons.empty();
  return verdict;
}

}  // namespace abbe::calib
