#include "abbe/calib/gate.hpp"

#include <algorithm>

#include "abbe/calib/model_comparison.hpp"
#include "message.hpp"

namespace abbe::calib {
namespace {

/// Tables are defined on their whole grid; polynomials are judged where their data were.
bool counts(const VolumetricModel& model, const Vector3& q) {
  return model.polynomials() == nullptr || model.validity().contains(q);
}

double max_error_m(const VolumetricModel& model, const Vector3& t) {
  double most = 0.0;
  for (const Vector3& q : tensor_grid(model.layout().nodes())) {
    if (counts(model, q)) {
      most = std::max(most, model.V_at(q, t).norm());
    }
  }
  return most;
}

/// Along an axis V of tables is linear between nodes and multilinear in the other two: its derivative is
/// largest on the grid lines. For polynomials this is the mean slope over an eighth of the volume.
double max_gradient(const VolumetricModel& model, const Vector3& t) {
  double most = 0.0;
  const MachineNodes& nodes = model.layout().nodes();
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
      if (!counts(model, q) || !counts(model, beside)) {
        continue;
      }
      most = std::max(most, (model.V_at(beside, t) - model.V_at(q, t)).norm() / (*next - q(k)));
    }
  }
  return most;
}

void require_better(Verdict& verdict, double candidate, double other, double min_improvement,
                    const char* than) {
  // Written so that a NaN figure is refused.
  if (!(candidate < other * (1.0 - min_improvement))) {
    verdict.reasons.push_back(
        message("held-out residual ", candidate, " sigma is not better than ", other, " sigma ", than,
                min_improvement > 0 ? message(" by ", 100 * min_improvement, " %") : ""));
  }
}

}  // namespace

Verdict decide(const VolumetricModel& candidate, const HeldOutFigures& held_out, const GateLimits& limits) {
  Verdict verdict;
  verdict.held_out = held_out;
  const Vector3 t = candidate.tool_offsets_m().front();
  verdict.max_error_m = max_error_m(candidate, t);
  verdict.max_gradient = max_gradient(candidate, t);
  if (held_out.observations == 0) {
    verdict.reasons.emplace_back("nothing was held out to test the model with");
  }
  require_better(verdict, held_out.candidate, held_out.no_compensation, limits.min_improvement,
                 "without compensation");
  if (held_out.active) {
    // The candidate's figure comes from fits to a part of the run, the active model from all of its own: on
    // an unchanged machine the active model stays.
    require_better(verdict, held_out.candidate, *held_out.active, limits.min_improvement,
                   "of the active model, so the active model still holds");
  }
  if (!(verdict.max_error_m <= limits.max_error_m)) {
    verdict.reasons.push_back(message("largest error ", 1e6 * verdict.max_error_m, " um exceeds ",
                                      1e6 * limits.max_error_m, " um"));
  }
  if (!(verdict.max_gradient <= limits.max_gradient)) {
    verdict.reasons.push_back(message("steepest change ", 1e6 * verdict.max_gradient, " um/m exceeds ",
                                      1e6 * limits.max_gradient, " um/m"));
  }
  verdict.accepted = verdict.reasons.empty();
  return verdict;
}

}  // namespace abbe::calib
