#include "abbe/calib/otf/plan/plan_prediction.hpp"

#include <algorithm>
#include <cmath>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/model/model_comparison.hpp"
#include "abbe/calib/otf/plan/plan_observable.hpp"
#include "abbe/calib/otf/run/polyline.hpp"
#include "abbe/calib/otf/solve/backlash.hpp"
#include "abbe/calib/otf/solve/solve.hpp"
#include "abbe/result/try.hpp"
#include "plan/plan_rows.hpp"
#include "plan/plan_volume.hpp"
#include "solve/systematic_effects.hpp"

namespace abbe::calib::otf {
namespace {

TableUncertainty uncertainty_of(std::string name, const Eigen::MatrixXd& covariance,
                                std::size_t first, std::size_t count) {
  TableUncertainty u{.name = std::move(name)};
  for (std::size_t i = first; i < first + count; ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    const double variance = std::max(covariance(k, k), 0.0);
    u.rms_u += variance / static_cast<double>(count);
    u.max_u = std::max(u.max_u, std::sqrt(variance));
  }
  u.rms_u = std::sqrt(u.rms_u);
  return u;
}

std::vector<TableUncertainty> uncertainties_of(const ParameterLayout& layout,
                                               const Eigen::MatrixXd& covariance) {
  std::vector<TableUncertainty> all;
  for (const Table& table : layout.tables()) {
    all.push_back(uncertainty_of(name(table.motion), covariance, table.offset,
                                 layout.node_count(table.motion.axis)));
  }
  for (std::size_t i = 0; i < kSquarenessNames.size(); ++i) {
    all.push_back(uncertainty_of(std::string(kSquarenessNames[i]), covariance,
                                 layout.squareness_offset() + i, 1));
  }
  return all;
}

/// Uncertainty of the differences between directions, one entry per table; empty without backlash.
std::vector<TableUncertainty> uncertainties_of_backlash(const Observations& o,
                                                        const Eigen::MatrixXd& covariance) {
  std::vector<TableUncertainty> all;
  std::size_t first = o.layout().model_size();
  for (const Table& table : o.layout().tables()) {
    const std::size_t count =
        o.basis.travel() == TravelDependence::Tables ? o.layout().node_count(table.motion.axis) : 1;
    if (estimates_backlash(o)) {
      all.push_back(uncertainty_of(name(table.motion), covariance, first, count));
    }
    first += count;
  }
  return all;
}

std::vector<std::string> tables_left_out(const ParameterLayout& layout) {
  std::vector<std::string> names;
  for (const Axis axis : kAllAxes) {
    for (const Motion motion : kAllMotions) {
      if (!layout.find({motion, axis})) {
        names.push_back(name(ErrorMotion{motion, axis}));
      }
    }
  }
  return names;
}

/// Evenly spaced places over the travel.
std::vector<Vector3> map_places(const MachineNodes& travel) {
  MachineNodes few;
  for (const Axis a : kAllAxes) {
    const double first_m = travel[index(a)].nodes_m.front(),
                 last_m = travel[index(a)].nodes_m.back();
    for (std::size_t i = 0; i < Prediction::kMapPlaces; ++i) {
      few[index(a)].nodes_m.push_back(first_m + (last_m - first_m) * static_cast<double>(i) /
                                                    double{Prediction::kMapPlaces - 1});
    }
  }
  return tensor_grid(few);
}

Result<void> check_tracker_off_path(const Path& path, const PlannedRun& run) {
  constexpr double kOffPath_m = 0.05;
  const double distance_m = distance_to_path_m(path, run.tracker_m - run.machine.target_offset_m);
  if (distance_m < kOffPath_m) {
    return failure(
        ErrorCode::BadInput,
        message("plan: the tracker at ", mm_text(run.tracker_m), " is ", 1e3 * distance_m,
                " mm from the path of the reflector, needs ", 1e3 * kOffPath_m, " mm"));
  }
  return {};
}

Result<void> check_all(const Path& path, const PlannedRun& run) {
  if (Result<void> valid = check(path, run.machine.nodes); !valid) {
    return valid;
  }
  if (Result<void> valid = check_tracker_off_path(path, run); !valid) {
    return valid;
  }
  if (Result<void> valid = check(run); !valid) {
    return valid;
  }
  return check_observable(path, run.machine, run.backlash);
}

/// Covariance as in the adjustment of a run: an offset of the ranges is an additional unknown with
/// a prior.
Eigen::MatrixXd covariance_of(const Observations& o, const Adjustment& a) {
  if (!(o.u_range_offset_m > 0.0)) {
    return a.covariance;
  }
  const std::vector<double> no_residuals(o.rows.size(), 0.0);
  const Eigen::MatrixXd root =
      with_run_effects(o, WhitenedRows(o), a, no_residuals, 1.0).root_of_covariance;
  return a.covariance + root * root.transpose();
}

}  // namespace

Result<Prediction> predict(const Path& path, const PlannedRun& run, std::size_t row_points) {
  ABBE_TRY(check_all(path, run));

  const Result<Observations> o = planned_observations(path, run, row_points);
  ABBE_TRY(o);
  const Result<Adjustment> a = adjust(information_of(*o), *o);
  ABBE_TRY(a);

  const Eigen::MatrixXd covariance = covariance_of(*o, *a);
  const RigidFreeVolume volume(o->layout(), run.machine.target_offset_m);
  Prediction p{.rms_u_m = volume.rms_u_m(covariance),
               .tables = uncertainties_of(o->layout(), covariance),
               .backlash = uncertainties_of_backlash(*o, covariance),
               .unused = note_on_unused(*o),
               .left_out = tables_left_out(o->layout()),
               .observations = o->rows.size(),
               .unknowns = o->unknowns(),
               .rank = a->rank,
               .datum_defect = a->datum_defect,
               .condition = a->condition,
               .length_m = lengths_to_vertices_m(path).back(),
               .duration_s = duration_s(path, run.drive)};
  for (const Vector3& q : map_places(run.machine.nodes)) {
    p.map.push_back({q, volume.u_m(q, covariance)});
    p.max_u_m = std::max(p.max_u_m, p.map.back().u_m);
  }
  return p;
}

}  // namespace abbe::calib::otf
