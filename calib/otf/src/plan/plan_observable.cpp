#include "abbe/calib/otf/plan/plan_observable.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"
#include "abbe/calib/internal/estimation/null_space.hpp"
#include "abbe/calib/model/model_datum.hpp"
#include "abbe/calib/otf/observe/segments.hpp"
#include "abbe/calib/otf/solve/solve.hpp"
#include "abbe/result/try.hpp"
#include "solve/datum_of.hpp"

namespace abbe::calib::otf {
namespace {

/// Appends rows of weight 1 along the leg. Any two directions across the leg give the same rank.
void append_unit_rows(Observations& o, std::size_t leg, const Path& path) {
  const Vector3 &from = path.vertices_m[leg], &to = path.vertices_m[leg + 1];
  const double corner_m = Options{}.corner_m, used_m = (to - from).norm() - 2.0 * corner_m;
  if (!(used_m > 0.0)) {
    return;
  }

  PointOnPath point;
  point.leg = leg;
  // A beam that is not parallel to any usual leg; its length has no effect.
  point.frame = path_frame(to - from, {0.3, 0.5, 0.8}, {});
  point.frame.sigma2_m = point.frame.sigma3_m = 1.0;
  const auto points = static_cast<std::size_t>(std::ceil(used_m / kSegmentTravel_m));
  for (std::size_t i = 0; i < points; ++i) {
    const double along_m =
        corner_m + used_m * (static_cast<double>(i) + 0.5) / static_cast<double>(points);
    point.axis_position_m = from + along_m * (to - from).normalized();
    append_rows(o, point, std::span(&point.axis_position_m, 1));
  }
}

/// Removes the rows; their information is kept elsewhere.
void clear_rows(Observations& o) {
  o.A = {};
  o.rows.clear();
  o.sub_points_m.clear();
}

/// Transforms the columns of `null_space` to datum G2. A combination that no run determines becomes
/// zero.
Eigen::MatrixXd in_datum(const Observations& o, const Eigen::MatrixXd& null_space) {
  // unobservable_combinations() has no rows for differences between directions of travel.
  const Eigen::MatrixXd of_layout =
      unobservable_combinations(o.layout(), std::array{o.target_offset_m});
  const auto model = static_cast<Eigen::Index>(o.layout().model_size()),
             rigid = static_cast<Eigen::Index>(kRigidUnknowns);
  Eigen::MatrixXd of_datum = Eigen::MatrixXd::Zero(null_space.rows(), of_layout.cols());
  of_datum.topRows(model) = of_layout.topRows(model);
  of_datum.middleRows(static_cast<Eigen::Index>(o.rigid_offset()), rigid) =
      of_layout.middleRows(model, rigid);
  const Result<Eigen::MatrixXd> S = datum_of(o).transformation(of_datum);
  return S ? Eigen::MatrixXd(*S * null_space) : null_space;
}

/// Names of the tables and squareness errors with a non-zero entry in a column of `undetermined`.
/// Differences between the directions of travel have a prior, so that their entries are zero.
std::vector<std::string> names_of(const Observations& o, const Eigen::MatrixXd& undetermined) {
  const ParameterLayout& layout = o.layout();
  // Limit of an entry that is not zero: columns have unit length, rounding is 1e-12.
  constexpr double kZero = 1e-6;
  const auto occurs = [&](std::size_t first, std::size_t count) {
    return undetermined
               .middleRows(static_cast<Eigen::Index>(first), static_cast<Eigen::Index>(count))
               .cwiseAbs()
               .maxCoeff() > kZero;
  };

  std::vector<std::string> names;
  for (const Table& table : layout.tables()) {
    if (occurs(table.offset, layout.node_count(table.motion.axis))) {
      names.push_back(name(table.motion));
    }
  }
  for (std::size_t i = 0; i < kSquarenessNames.size(); ++i) {
    if (occurs(layout.squareness_offset() + i, 1)) {
      names.emplace_back(kSquarenessNames[i]);
    }
  }

  return names;
}

/// Text about parts of the travel of more than one cell, such as "; X 100 to 300 mm is not
/// reached".
std::string parts_not_reached(const Path& path, const MachineNodes& travel) {
  std::string text;
  for (const Axis a : kAllAxes) {
    const std::vector<double>& nodes_m = travel[index(a)].nodes_m;
    const auto [least, most] =
        std::minmax_element(path.vertices_m.begin(), path.vertices_m.end(),
                            [k = static_cast<Eigen::Index>(index(a))](
                                const Vector3& p, const Vector3& q) { return p[k] < q[k]; });
    const double low_m = (*least)[static_cast<Eigen::Index>(index(a))],
                 high_m = (*most)[static_cast<Eigen::Index>(index(a))];
    const auto part = [&](double from_m, double to_m) {
      text += message("; ", letter(a), " ", kMmPerM * from_m, " to ", kMmPerM * to_m,
                      " mm is not reached");
    };
    if (low_m > nodes_m[1]) {
      part(nodes_m.front(), low_m);
    }
    if (high_m < nodes_m[nodes_m.size() - 2]) {
      part(high_m, nodes_m.back());
    }
  }
  return text;
}

std::string listed(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) {
    text += (text.empty() ? "" : ", ") + name;
  }
  return text;
}

}  // namespace

Result<Observability> observability(const Path& path, const Machine& machine,
                                    TravelDependence backlash) {
  Machine linear = machine;  // linear tables save time and hardly change the rank
  linear.interpolation = Interpolation::Linear;
  Result<Observations> empty = observations_without_rows(linear, path, {}, {}, backlash);
  ABBE_TRY(empty);

  Observations o = *std::move(empty);
  const Result<std::size_t> first = first_with_backlash(o);
  ABBE_TRY(first);

  const auto conditions = static_cast<std::size_t>(datum_of(o).conditions().rows());
  Observability result{.needed = o.unknowns() - conditions, .unused = note_on_unused(o)};
  estimation::Information data = with_backlash_prior(estimation::Information(o.unknowns()), o);

  // Further legs never decrease the rank. Groups of increasing size keep the number of rank
  // decompositions small.
  const std::size_t legs = path.vertices_m.empty() ? 0 : path.vertices_m.size() - 1;
  for (std::size_t leg = *first, group = 32; leg < legs && result.rank < result.needed;
       group *= 2) {
    for (const std::size_t end = std::min(legs, leg + group); leg < end; ++leg) {
      append_unit_rows(o, leg, path);
    }
    data += information_of(o).data;
    clear_rows(o);
    result.rank = estimation::pivoted_rank(data);
  }

  if (result.rank < result.needed) {
    result.undetermined = names_of(o, in_datum(o, estimation::null_space(data).basis));
  }
  return result;
}

Result<void> check_observable(const Path& path, const Machine& machine, TravelDependence backlash) {
  const Result<Observability> seen = observability(path, machine, backlash);
  ABBE_TRY(seen);
  if (seen->undetermined.empty()) {
    return {};
  }
  return failure(
      ErrorCode::RankDeficient,
      message("path: it does not determine ", listed(seen->undetermined), " (rank ", seen->rank,
              ", needs ", seen->needed, ")", parts_not_reached(path, machine.nodes),
              seen->unused.empty() ? "" : "; ", seen->unused,
              ": add legs in other directions and at other heights; `abbe plan otf` "
              "computes a path"));
}

}  // namespace abbe::calib::otf
