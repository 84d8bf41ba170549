#include "abbe/calib/mfb/observe/observe.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"
#include "abbe/calib/internal/mfb/observe/pass_touches.hpp"
#include "abbe/calib/internal/mfb/run/orientation.hpp"
#include "abbe/result/try.hpp"
#include "observe/observations.hpp"

namespace abbe::calib::mfb {
namespace {

double rms_to_signature(const std::vector<Vector3>& O_bar_m, const Bar& calibrated) {
  double squares = 0.0;
  for (std::size_t i = 0; i < O_bar_m.size(); ++i) {
    const double off_m = O_bar_m[i].y() - calibrated.O_m[i].y();
    squares += off_m * off_m;
  }
  return std::sqrt(squares / static_cast<double>(O_bar_m.size()));
}

std::vector<Vector3> in_bar_frame(const ExtractedBar& bar) {
  std::vector<Vector3> O_bar_m;
  for (const Vector3& O : bar.O_m) {
    O_bar_m.emplace_back(bar.pose.axes.transpose() * (O - bar.pose.origin_m));
  }
  return O_bar_m;
}

Result<void> check_calibrated_places(const ExtractedBar& bar, const Bar& calibrated,
                                     const ObserveLimits& limits) {
  const std::vector<Vector3> O_bar_m = in_bar_frame(bar);
  for (std::size_t i = 0; i < O_bar_m.size(); ++i) {
    const double off_m = (O_bar_m[i] - calibrated.O_m[i]).norm();
    if (!(off_m <= limits.calibrated_m)) {
      return failure(
          ErrorCode::NotApplicable,
          message(hole_name(i), ": its point of interest is ", kMmPerM * off_m,
                  " mm beside its calibrated place, at most ", kMmPerM * limits.calibrated_m,
                  " mm: the bar file is that of another bar"));
    }
  }
  return {};
}

/// Finds the orientation of the bar. The signature is the calibrated y of the holes, which contains
/// the nominal shifts.
Result<OrientationFit> found_orientation(const ExtractedBar& bar, const Bar& calibrated) {
  std::vector<double> signature_m;
  for (const Vector3& O : calibrated.O_m) {
    signature_m.push_back(O.y());
  }
  return orientation_of(in_bar_frame(bar), signature_m);
}

Result<void> check_not_turned(const OrientationFit& fit, double as_planned_rms_m) {
  if (fit.orientation == Orientation::Normal) {
    return {};
  }
  return failure(
      ErrorCode::NotApplicable,
      message("the bar lies ", name(fit.orientation), ": ", kMmPerM * fit.rms_m, " mm against ",
              kMmPerM * as_planned_rms_m, " mm as planned: turn it and measure again"));
}

/// Checks the orientation. `of_known_bar`: features and sizes are those of the bar, so that not
/// finding an orientation is an error.
Result<void> check_orientation(const ExtractedBar& bar, const Bar& calibrated, bool of_known_bar) {
  if (!calibrated.pattern.has_signature()) {
    return {};
  }
  const Result<OrientationFit> fit = found_orientation(bar, calibrated);
  if (!fit) {
    return of_known_bar ? tl::unexpected(fit.error()) : Result<void>{};
  }
  return check_not_turned(*fit, rms_to_signature(in_bar_frame(bar), calibrated));
}

Result<void> check_beside_plan(const BarPose& found, const BarPose& planned,
                               const ObserveLimits& limits) {
  const double off_m = (found.origin_m - planned.origin_m).norm();
  const double off_rad =
      std::abs(Eigen::AngleAxisd(Matrix3(planned.axes.transpose() * found.axes)).angle());
  if (off_m <= limits.beside_plan_m && off_rad <= limits.beside_plan_rad) {
    return {};
  }
  constexpr double kMrad = 1e3;
  return failure(ErrorCode::NotApplicable,
                 message("the bar stands ", kMmPerM * off_m, " mm and ", kMrad * off_rad,
                         " mrad beside the plan, at most ", kMmPerM * limits.beside_plan_m,
                         " mm and ", kMrad * limits.beside_plan_rad,
                         " mrad: another position or tool, or the plan is wrong"));
}

Result<ExtractedBar> checked_bar(const Observations& o, const PassObservation& pass,
                                 const SortedTouches& sorted, const ObserveLimits& limits) {
  const TouchPattern& pattern = o.bar.pattern;
  const BarPose& planned = o.positions[pass.position].planned;
  return extracted(bar_touches(pattern, sorted.place, sorted.tip_m), planned.axes)
      .and_then([&](ExtractedBar bar) -> Result<ExtractedBar> {
        Result<void> valid =
            check_orientation(bar, o.bar, false)
                .and_then([&] {
                  return check_features(bar.features, pattern, o.plan.tip_radius_m, bar.pose,
                                        limits);
                })
                .and_then([&] { return check_orientation(bar, o.bar, true); })
                .and_then([&] { return check_beside_plan(bar.pose, planned, limits); })
                .and_then([&] { return check_calibrated_places(bar, o.bar, limits); });
        ABBE_TRY(valid);
        return bar;
      })
      .map_error([&](Error error) {
        error.text = message(o.plan.measurements[pass.measurement].name, ": ", error.text);
        return error;
      });
}

/// Sets derivatives and normals for the touched places instead of the nominal ones. This is
/// necessary because features may be 1 mm beside the pattern, and some combinations of O_i have a
/// noise of only a few nm.
void set_derivatives_of_touches(const Observations& o, PassObservation& pass,
                                const std::vector<Vector3>& tips_m) {
  const BarPose& pose = o.positions[pass.position].pose;
  std::vector<Vector3> in_bar_m;
  for (const Vector3& tip_m : tips_m) {
    in_bar_m.emplace_back(pose.axes.transpose() * (tip_m - pose.origin_m));
  }
  const Result<PointsOfInterest> points =
      points_of_interest(bar_touches(o.bar.pattern, pass.touched, in_bar_m), Matrix3::Identity());
  if (points) {  // otherwise the derivatives of the nominal bar are kept
    pass.dO_dtouch = points->dO_dtouch;
    pass.normal = points->normals;
  }
}

void set_deviations(const Observations& o, PassObservation& pass, const std::vector<Vector3>& O_m,
                    const std::vector<NominalTouch>& touches) {
  const BarPose& pose = o.positions[pass.position].pose;
  const std::vector<Vector3> calibrated_m = O_at(o.bar, pass.temperature_K);
  for (std::size_t i = 0; i < O_m.size(); ++i) {
    pass.delta_m.segment<3>(3 * static_cast<Eigen::Index>(i)) =
        pose.axes.transpose() * (O_m[i] - pose.origin_m) - calibrated_m[i];
  }
  pass.delta_m -= sag_of_points(o, pass, touches);
}

}  // namespace

Result<void> observe_pass(Observations& o, PassObservation& pass, const PassTouches& touches,
                          NominalBar& nominal, const ObserveLimits& limits, bool sets_pose) {
  const Result<SortedTouches> sorted =
      sorted_touches(o.bar.pattern, o.plan.measurements[pass.measurement], touches);
  ABBE_TRY(sorted);
  const Result<ExtractedBar> found = checked_bar(o, pass, *sorted, limits);
  ABBE_TRY(found);

  if (sets_pose) {
    o.positions[pass.position].pose = found->pose;
  }
  if (Result<void> placed = place_touches(o, pass, nominal, sorted->place, sorted->time); !placed) {
    return placed;
  }
  set_derivatives_of_touches(o, pass, sorted->tip_m);
  set_deviations(o, pass, found->O_m, nominal.touches());
  return {};
}

Result<Observations> observe(const Bar& bar, const Plan& plan, std::span<const PassTouches> touches,
                             const MfbMachine& machine, const ObserveLimits& limits) {
  Result<Observations> o = observations_of_plan(bar, plan, machine);
  if (!o) {
    return o;
  }
  if (touches.size() != plan.measurements.size()) {
    return failure(
        ErrorCode::BadInput,
        message(touches.size(), " passes were touched, the plan has ", plan.measurements.size()));
  }

  NominalBar nominal(bar, plan.tip_radius_m);
  std::vector<bool> has_pose(o->positions.size(), false);
  for (PassObservation& pass : o->passes) {
    const bool first = !has_pose[pass.position];
    has_pose[pass.position] = true;
    ABBE_TRY(observe_pass(*o, pass, touches[pass.measurement], nominal, limits, first));
  }
  return o;
}

Result<Observations> planned_observations(const Bar& bar, const Plan& plan,
                                          const MfbMachine& machine) {
  Result<Observations> o = observations_of_plan(bar, plan, machine);
  if (!o) {
    return o;
  }

  NominalBar nominal(bar, plan.tip_radius_m);
  std::vector<std::size_t> all(nominal.touches().size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  const std::vector<std::size_t> order = probing_order(nominal.touches());
  std::vector<double> forward(all.size()), backward(all.size());
  for (std::size_t row = 0; row < order.size(); ++row) {
    forward[order[row]] = static_cast<double>(row) / (static_cast<double>(order.size()) - 1.0);
    backward[order[row]] = 1.0 - forward[order[row]];
  }
  for (PassObservation& pass : o->passes) {
    const bool is_forward = plan.measurements[pass.measurement].direction == PassDirection::Forward;
    ABBE_TRY(place_touches(*o, pass, nominal, all, is_forward ? forward : backward));
  }
  return o;
}

}  // namespace abbe::calib::mfb
