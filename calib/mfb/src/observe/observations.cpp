#include "observe/observations.hpp"

#include <algorithm>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"
#include "abbe/calib/internal/mfb/observe/pass_touches.hpp"
#include "abbe/result/try.hpp"

namespace abbe::calib::mfb {
namespace {

/// Index of the position of a measurement; a new position is appended.
std::size_t position_index(Observations& o, const Measurement& m) {
  for (std::size_t i = 0; i < o.positions.size(); ++i) {
    if (o.positions[i].name == m.position) {
      return i;
    }
  }
  const BarPose planned{m.origin_m, m.axes()};
  o.positions.push_back({m.position, planned, planned, o.bar.O_m.back()});
  return o.positions.size() - 1;
}

/// Index of the tool in its position: tools with the same offset are the same.
std::size_t tool_index(const Observations& o, const PassObservation& pass) {
  std::size_t tools = 0;
  for (const PassObservation& other : o.passes) {
    if (other.position != pass.position) {
      continue;
    }
    if (o.plan.measurements[other.measurement].tool_offset_m ==
        o.plan.measurements[pass.measurement].tool_offset_m) {
      return other.tool;
    }
    tools = std::max(tools, other.tool + 1);
  }
  return tools;
}

void set_pairs(Observations& o) {
  const auto forward_of = pairs_of(o.plan.measurements);
  std::vector<std::size_t> pairs(o.positions.size(), 0);
  for (std::size_t i = 0; i < o.passes.size(); ++i) {
    if (forward_of[i]) {
      const std::size_t pair = pairs[o.passes[i].position]++;
      o.passes[*forward_of[i]].pair = pair;
      o.passes[i].pair = pair;
      o.passes[i].second_of_pair = true;
    }
  }
}

/// BadInput for a reading more than half a cell beyond the first or last node. Within this distance
/// the polynomial of the last cell is used.
Result<void> check_inside(const Vector3& reading_m, const MachineNodes& nodes) {
  for (const Axis a : kAllAxes) {
    const std::vector<double>& x = nodes[index(a)].nodes_m;
    const double q = reading_m(static_cast<Eigen::Index>(index(a)));
    const double before = x[0] - 0.5 * (x[1] - x[0]);
    const double behind = x.back() + 0.5 * (x.back() - x[x.size() - 2]);
    if (!(before <= q && q <= behind)) {
      return failure(ErrorCode::BadInput,
                     message("the reading ", kMmPerM * q, " mm of ", letter(a),
                             " is more than half a node spacing outside its nodes ", kMmPerM * x[0],
                             " to ", kMmPerM * x.back(), " mm"));
    }
  }
  return {};
}

}  // namespace

NominalBar::NominalBar(const Bar& bar, double tip_radius_m)
    : pattern_(bar.pattern), touches_(nominal_touches(bar.pattern, tip_radius_m)) {}

Result<Eigen::MatrixXd> NominalBar::dO_dtouch(const std::vector<std::size_t>& places) {
  if (const auto known = known_.find(places); known != known_.end()) {
    return known->second;
  }
  std::vector<Vector3> tips_m;
  for (const std::size_t place : places) {
    tips_m.push_back(touches_[place].tip_m);
  }
  return points_of_interest(bar_touches(pattern_, places, tips_m), Matrix3::Identity())
      .map([&](PointsOfInterest points) {
        return known_.emplace(places, std::move(points.dO_dtouch)).first->second;
      });
}

Result<Observations> observations_of_plan(const Bar& bar, const Plan& plan,
                                          const MfbMachine& machine) {
  if (Result<void> valid = check(bar).and_then([&] { return check(plan, bar); }); !valid) {
    return tl::unexpected(valid.error());
  }
  Result<TableBasis> basis =
      ParameterLayout::all_tables(machine.chain, machine.nodes)
          .and_then([&](ParameterLayout layout) {
            return TableBasis::of(std::move(layout), TableOptions::all_axes(machine.interpolation));
          });
  ABBE_TRY(basis);

  Observations o{bar, plan, *std::move(basis), {}, {}, {}};
  o.plan.gravity.normalize();
  for (std::size_t i = 0; i < plan.measurements.size(); ++i) {
    PassObservation pass;
    pass.measurement = i;
    pass.position = position_index(o, plan.measurements[i]);
    pass.tool = tool_index(o, pass);
    pass.temperature_K = plan.measurements[i].temperature_K.value_or(kReferenceTemperature_K);
    pass.delta_m = Eigen::VectorXd::Zero(3 * std::ssize(bar.O_m));
    o.passes.push_back(std::move(pass));
  }
  set_pairs(o);
  if (!bar.pattern.has_signature()) {
    o.notes.emplace_back("the bar has no signature: a turned bar is not recognised");
  }
  return o;
}

Result<void> place_touches(Observations& o, PassObservation& pass, NominalBar& nominal,
                           std::vector<std::size_t> places, const std::vector<double>& time) {
  const Measurement& m = o.plan.measurements[pass.measurement];
  const auto named = [&m](Error error) {
    error.text = message(m.name, ": ", error.text);
    return error;
  };
  Result<Eigen::MatrixXd> derivatives = nominal.dO_dtouch(places).map_error(named);
  ABBE_TRY(derivatives);

  const BarPose& pose = o.positions[pass.position].pose;
  pass.dO_dtouch = *std::move(derivatives);
  pass.reading_m.clear();
  pass.normal.clear();
  pass.time.resize(std::ssize(places));
  for (std::size_t i = 0; i < places.size(); ++i) {
    const NominalTouch& touch = nominal.touches()[places[i]];
    pass.reading_m.emplace_back(pose.origin_m + pose.axes * touch.tip_m - m.tool_offset_m);
    pass.normal.push_back(touch.outward);
    pass.time(static_cast<Eigen::Index>(i)) = time[i] + (pass.second_of_pair ? 1.0 : 0.0);
    if (Result<void> inside = check_inside(pass.reading_m.back(), o.basis.layout().nodes());
        !inside) {
      return failure(inside.error().code,
                     message(m.name, ": ", name(touch.target), ": ", inside.error().text));
    }
  }
  pass.touched = std::move(places);
  return {};
}

Eigen::VectorXd sag_of_points(const Observations& o, const PassObservation& pass,
                              const std::vector<NominalTouch>& touches) {
  Eigen::VectorXd along_normal = Eigen::VectorXd::Zero(std::ssize(pass.touched));
  if (o.bar.sag) {
    const Vector3 gravity = o.positions[pass.position].pose.axes.transpose() * o.plan.gravity;
    for (std::size_t i = 0; i < pass.touched.size(); ++i) {
      const NominalTouch& touch = touches[pass.touched[i]];
      along_normal(static_cast<Eigen::Index>(i)) =
          pass.normal[i].dot(sag_m(*o.bar.sag, touch.tip_m.x(), gravity));
    }
  }
  return pass.dO_dtouch * along_normal;
}

}  // namespace abbe::calib::mfb
