#include "abbe/calib/mfb/solve/identify.hpp"

#include <algorithm>
#include <cmath>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/model/model_comparison.hpp"
#include "abbe/calib/statistics/root_sum_of_squares.hpp"
#include "abbe/result/try.hpp"
#include "solve/likely_cause.hpp"
#include "solve/set_aside_touches.hpp"

namespace abbe::calib::mfb {
namespace {

/// Observations, solution and residuals without the excluded touches.
struct Adjusted {
  Observations observations;
  Solution solution;
  std::vector<ResidualsOfFeature> residuals;
};

Result<Adjusted> adjusted(const Bar& bar, const Plan& plan, std::span<const PassTouches> touches,
                          const MfbMachine& machine, const Options& options) {
  return observe(bar, plan, touches, machine, options.limits).and_then([&](Observations o) {
    return solve(o, options.solve).map([&](Solution solution) {
      std::vector<ResidualsOfFeature> residuals = feature_residuals(o, touches, solution.U);
      return Adjusted{std::move(o), std::move(solution), std::move(residuals)};
    });
  });
}

/// Largest number of touches of a pass that may be excluded.
std::size_t most_of_pass(const PassTouches& touches, const SetAsideOptions& options) {
  return static_cast<std::size_t>(
      std::ceil(options.most_of_pass * static_cast<double>(touches.size())));
}

struct Outliers {
  std::vector<SetAsideTouch> set_aside;
  std::vector<std::string> unresolved;
};

std::size_t most_of_all(std::span<const PassTouches> touches, const SetAsideOptions& options) {
  std::size_t all = 0;
  for (const PassTouches& pass : touches) {
    all += pass.size();
  }
  return static_cast<std::size_t>(std::ceil(options.most_of_all * static_cast<double>(all)));
}

/// Excludes touches one after another and repeats the adjustment after each.
Result<Adjusted> without_outliers(Adjusted at, const Bar& bar, const Plan& plan,
                                  std::vector<PassTouches>& touches, const MfbMachine& machine,
                                  const Options& options, Outliers& outliers) {
  std::vector<std::string>& left = outliers.unresolved;
  std::vector<std::size_t> of_pass(touches.size(), 0);
  while (const std::optional<Suspects> found =
             suspects(at.observations, at.residuals, options.outliers, left)) {
    const std::size_t m = found->measurement;
    if (of_pass[m] >= most_of_pass(touches[m], options.outliers) ||
        outliers.set_aside.size() >= most_of_all(touches, options.outliers)) {
      left.push_back(name_in_plan(plan, m, found->touches.front()));
      continue;
    }

    const std::size_t worst =
        found->touches.front().feature == Feature::Plane
            ? farthest_suspect(at.observations, at.solution.poses, at.residuals, *found)
            : worst_suspect(at.observations, touches, *found, options);
    ++of_pass[m];
    set_aside(touches[m], found->touches[worst]);
    outliers.set_aside.push_back(
        {m, plan.measurements[m].name, found->touches[worst], found->off_m[worst]});
    Result<Adjusted> next = adjusted(bar, plan, touches, machine, options);
    if (!next) {
      return next;
    }
    at = *std::move(next);
  }
  return at;
}

/// Box of the readings of all touches, inside the nodes.
Result<ValidityVolume> touched_box(const Observations& o) {
  Vector3 low_m = o.passes.front().reading_m.front(), high_m = low_m;
  for (const PassObservation& pass : o.passes) {
    for (const Vector3& q_m : pass.reading_m) {
      low_m = low_m.cwiseMin(q_m);
      high_m = high_m.cwiseMax(q_m);
    }
  }

  MachineNodes ends = o.basis.layout().nodes();
  for (const Axis a : kAllAxes) {
    const auto k = static_cast<Eigen::Index>(index(a));
    std::vector<double>& nodes_m = ends[index(a)].nodes_m;
    nodes_m = {std::max(low_m(k), nodes_m.front()), std::min(high_m(k), nodes_m.back())};
  }
  return ValidityVolume::hull_of(tensor_grid(ends));
}

std::vector<Vector3> tools_of(const Plan& plan) {
  std::vector<Vector3> tools_m;
  for (const Measurement& m : plan.measurements) {
    if (std::find(tools_m.begin(), tools_m.end(), m.tool_offset_m) == tools_m.end()) {
      tools_m.push_back(m.tool_offset_m);
    }
  }
  return tools_m;
}

Result<VolumetricModel> model_of(const Observations& o, const Solution& solution) {
  return touched_box(o).and_then([&](ValidityVolume volume) {
    return VolumetricModel::from_vector(o.basis, ModelDatum::G2, tools_of(o.plan), solution.U,
                                        solution.covariance, std::move(volume));
  });
}

/// Likely cause for Estimator::Sequential. It is not an adjustment: its residuals also contain
/// effects that the method neglects, so that they do not prove a fault.
LikelyCause cause_of_sequence(const Statistics& s) {
  if (!(s.chi2_per_dof > s.chi2_per_dof_limit)) {
    return {};
  }
  return {
      Cause::Unknown,
      message("chi-square per degree of freedom is ", s.chi2_per_dof, ", at most ",
              s.chi2_per_dof_limit,
              ": the sequence loses the slope of EAX and the places of the rods; the simultaneous "
              "estimator tells faults of the measurement from that"),
      s.chi2_per_dof};
}

std::vector<TouchResidual> residuals_of_touches(const std::vector<ResidualsOfFeature>& features,
                                                const std::vector<SetAsideTouch>& set_aside) {
  std::vector<TouchResidual> all;
  for (const ResidualsOfFeature& f : features) {
    for (std::size_t i = 0; i < f.k.size(); ++i) {
      Target target = f.feature;
      target.k = f.k[i];
      all.push_back({f.measurement, target, f.residual_m[i], false});
    }
  }
  for (const SetAsideTouch& touch : set_aside) {
    all.push_back({touch.measurement, touch.target, touch.residual_m, true});
  }
  return all;
}

}  // namespace

std::string_view name(Cause cause) {
  switch (cause) {
    case Cause::None:
      return "none";
    case Cause::Drift:
      return "drift";
    case Cause::Hole:
      return "hole";
    case Cause::Measurement:
      return "measurement";
    case Cause::Unknown:
      break;
  }
  return "unknown";
}

Result<Identification> identify(const Bar& bar, const Plan& plan,
                                std::span<const PassTouches> given, const MfbMachine& machine,
                                const Options& options) {
  std::vector<PassTouches> touches(given.begin(), given.end());
  Outliers outliers;
  Result<Adjusted> at =
      adjusted(bar, plan, touches, machine, options).and_then([&](Adjusted first) {
        return options.outliers.enabled ? without_outliers(std::move(first), bar, plan, touches,
                                                           machine, options, outliers)
                                        : Result<Adjusted>(std::move(first));
      });
  ABBE_TRY(at);

  Result<VolumetricModel> model = model_of(at->observations, at->solution);
  ABBE_TRY(model);
  LikelyCause cause = options.solve.estimator == Estimator::Simultaneous
                          ? likely_cause(at->observations, at->solution, options.solve)
                          : cause_of_sequence(at->solution.statistics);
  std::vector<std::string> notes = at->observations.notes;
  for (const std::string& feature : outliers.unresolved) {
    notes.push_back(message(feature,
                            ": the touches do not fit together, and too many are wrong or "
                            "missing to find out which: touch it again"));
  }
  auto touch_residuals = residuals_of_touches(at->residuals, outliers.set_aside);
  return Identification{std::move(at->observations),
                        std::move(at->solution),
                        *std::move(model),
                        std::move(outliers.set_aside),
                        std::move(outliers.unresolved),
                        std::move(touch_residuals),
                        root_sum_of_squares(plan.noise.probe_m, plan.noise.machine_m),
                        std::move(cause),
                        std::move(notes)};
}

}  // namespace abbe::calib::mfb
