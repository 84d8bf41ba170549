#include "identify/bar_line.hpp"

#include <cmath>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"
#include "abbe/result/try.hpp"

namespace abbe::calib::mfb {
namespace {

constexpr double kMradPerRad = 1e3;

Result<AxisAlongBar> axis_along_bar(const Plan& plan) {
  constexpr double kMostFromAxis_rad = 20e-3;
  const Vector3 first = plan.measurements.front().bar_x.normalized();
  AxisAlongBar along;
  first.cwiseAbs().maxCoeff(&along.axis);
  along.sign = std::copysign(1.0, first(along.axis));

  for (const Measurement& m : plan.measurements) {
    const double off = (m.bar_x.normalized() - along.sign * Vector3::Unit(along.axis)).norm();
    if (off > kMostFromAxis_rad) {
      return failure(ErrorCode::BadInput,
                     message(m.name, ": bar_x is ", kMradPerRad * off, " mrad from ",
                             along.sign < 0.0 ? "-" : "", "XYZ"[along.axis],
                             ": for a calibration the bar lies along one axis in all passes"));
    }
  }
  return along;
}

/// The part of `v` perpendicular to the x axis of `axes`, in the coordinates of `axes`.
Vector3 part_across(const Matrix3& axes, const Vector3& v) {
  Vector3 part = axes.transpose() * v;
  part.x() = 0.0;
  return part;
}

Vector3 middle_of(const BarPose& pose, const Bar& bar) {
  return pose.origin_m + 0.5 * pose.axes * bar.O_m.back();
}

void add_coordinates(const Observations& o, const PassObservation& pass, BarLine& line) {
  const BarPose& pose = o.positions[pass.position].pose;
  const Measurement& m = o.plan.measurements[pass.measurement];
  const std::vector<Vector3> O_m = O_at(o.bar, pass.temperature_K);
  const auto passes = static_cast<double>(o.passes.size());
  for (std::size_t i = 0; i < O_m.size(); ++i) {
    const Vector3 off_m = pass.delta_m.segment<3>(3 * static_cast<Eigen::Index>(i));
    const Vector3 place_m = pose.origin_m + pose.axes * (O_m[i] + off_m);
    line.coordinate_m[i] += line.along.of(Vector3(place_m - m.tool_offset_m)) / passes;
  }
}

/// Standard uncertainty of each of the two angles of the bar, from the scatter of the directions of
/// the passes.
double u_of_direction(const Observations& o, const Matrix3& axes) {
  double squares = 0.0;
  for (const PassObservation& pass : o.passes) {
    squares += part_across(axes, o.positions[pass.position].pose.axes.col(0)).squaredNorm();
  }
  const auto passes = static_cast<double>(o.passes.size());
  return passes < 2.0 ? 0.0 : std::sqrt(0.5 * squares / ((passes - 1.0) * passes));
}

}  // namespace

Result<BarLine> line_of_bar(const Observations& o) {
  const Result<AxisAlongBar> along = axis_along_bar(o.plan);
  ABBE_TRY(along);

  BarLine line{.along = *along, .length_m = o.bar.O_m.back().x()};
  line.coordinate_m.assign(o.bar.O_m.size(), 0.0);
  Measurement mean = o.plan.measurements.front();
  mean.bar_x.setZero();
  for (const PassObservation& pass : o.passes) {
    const BarPose& pose = o.positions[pass.position].pose;
    mean.bar_x += pose.axes.col(0);
    line.middle_m += middle_of(pose, o.bar) / static_cast<double>(o.passes.size());
    add_coordinates(o, pass, line);
  }
  line.axes = mean.axes();
  line.u_direction_rad = u_of_direction(o, line.axes);
  return line;
}

std::string angle_text(const Matrix3& axes, const Vector3& direction) {
  const Vector3 angles = part_across(axes, direction);
  return message(two_digits(kMradPerRad * angles.norm()), " mrad (y ",
                 two_digits(kMradPerRad * angles.y()), ", z ", two_digits(kMradPerRad * angles.z()),
                 " mrad)");
}

std::vector<std::string> notes_of_line(const Observations& o, const BarLine& line,
                                       double alignment_rad) {
  constexpr double kMostBeside_m = 1e-3, kMostTurned_rad = 2e-3;
  std::vector<std::string> notes;
  for (const PassObservation& pass : o.passes) {
    const BarPose& pose = o.positions[pass.position].pose;
    const Vector3 beside_m = part_across(line.axes, middle_of(pose, o.bar) - line.middle_m);
    const double turned_rad = part_across(line.axes, pose.axes.col(0)).norm();
    if (beside_m.norm() > kMostBeside_m || turned_rad > kMostTurned_rad) {
      notes.push_back(message(
          o.plan.measurements[pass.measurement].name, ": the bar lay ", kMmPerM * beside_m.norm(),
          " mm and ", angle_text(line.axes, pose.axes.col(0)),
          " from the mean of all passes: other blocks, or it moved; the rotations of the machine "
          "act on this distance, and it is not in the uncertainty"));
    }
  }

  const Vector3 planned = o.plan.measurements.front().bar_x.normalized();
  if (part_across(line.axes, planned).norm() > alignment_rad) {
    notes.push_back(message("bar_x of the plan is ", angle_text(line.axes, planned),
                            " from the bar as it lay: the direction of the touches is used"));
  }
  return notes;
}

}  // namespace abbe::calib::mfb
