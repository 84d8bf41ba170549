#include "abbe/sim/mfb/clamped_bar.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "mfb/constants.hpp"
#include "mfb/numbers.hpp"

namespace abbe::sim::mfb {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix3d;
using Eigen::Vector3d;

Matrix3d rotation(const Vector3d& rotation_rad) {
  return Eigen::AngleAxisd(rotation_rad.norm(), rotation_rad.stableNormalized()).toRotationMatrix();
}

/// The first measurement in the plan with the same position.
std::size_t first_at_position(std::span<const Measurement> plan, std::size_t m) {
  const auto same = [&](const Measurement& other) { return other.position == plan[m].position; };
  return static_cast<std::size_t>(std::find_if(plan.begin(), plan.end(), same) - plan.begin());
}

/// T_machine_bar of the bar as clamped, for a bar that is not turned.
Isometry3d pose_of(const Measurement& m, double length_m, const ProbingOptions& options,
                   std::uint64_t position) {
  const Numbers draw{options.seed, NoiseStream::BarPose, position};
  const Vector3d middle_m(0.5 * length_m, 0.0, 0.0);
  Matrix3d axes;
  axes << m.bar_x, m.bar_z.cross(m.bar_x), m.bar_z;

  Isometry3d T_machine_bar = Isometry3d::Identity();
  T_machine_bar.translate(m.origin_m + options.clamping_m * draw.vector(0));
  T_machine_bar.rotate(axes);
  T_machine_bar.translate(middle_m);
  T_machine_bar.rotate(rotation(options.clamping_rad * draw.vector(3)));
  T_machine_bar.translate(-middle_m);
  return T_machine_bar;
}

/// T_planned_bar of a bar that is clamped turned, about an axis through its middle.
Isometry3d turned_pose(Turned turned, double length_m) {
  constexpr double kHalfTurn_rad = 3.14159265358979323846;
  const Vector3d middle_m(0.5 * length_m, 0.0, 0.0);
  Isometry3d T = Isometry3d::Identity();
  T.translate(middle_m);
  T.rotate(Eigen::AngleAxisd(kHalfTurn_rad, Vector3d::Unit(static_cast<Eigen::Index>(turned))));
  T.translate(-middle_m);
  return T;
}

std::optional<Turned> how_turned(const Measurement& m, const ProbingOptions& options) {
  for (const std::string& key : {m.name, m.position}) {
    const auto found = options.turned.find(key);
    if (found != options.turned.end()) return found->second;
  }
  return std::nullopt;
}

void set_temperature(ClampedBar& out, const ProbingOptions& options, std::uint64_t position) {
  const BarTemperature& t = options.temperature;
  const Numbers at_position{options.seed, NoiseStream::BarTemperature, position + 1};
  const Numbers of_bar{options.seed, NoiseStream::BarTemperature, 0};
  out.stated_C = t.stated_C + t.spread_K * at_position.number(0);
  const double true_C = out.stated_C + t.u_K * at_position.number(1);
  const double alpha_per_K = t.alpha_per_K + t.u_alpha_per_K * of_bar.number(0);
  out.growth = 1.0 + alpha_per_K * (true_C - kReference_C);
}

void set_shape(ClampedBar& out, const ProbingOptions& options, std::uint64_t m) {
  const Numbers draw{options.seed, NoiseStream::BarShape, m};
  const std::size_t holes = out.bar.pattern.hole_x_m.size();
  out.shape_m.assign(holes, Vector3d::Zero());
  for (std::size_t i = 1; i < holes; ++i)
    out.shape_m[i] = options.shape_scatter_m * draw.vector(3 * i);
  out.shape_m.back().tail<2>().setZero();
}

/// Displacement by the clamping at x of the bar, linear between the holes.
Vector3d shape_at(const ClampedBar& clamped, double x_m) {
  const auto& at_m = clamped.bar.pattern.hole_x_m;
  const auto& shape_m = clamped.shape_m;
  const auto above = std::upper_bound(at_m.begin() + 1, at_m.end() - 1, x_m);
  const auto i = static_cast<std::size_t>(above - at_m.begin());
  const double u = std::clamp((x_m - at_m[i - 1]) / (at_m[i] - at_m[i - 1]), 0.0, 1.0);
  return (1.0 - u) * shape_m[i - 1] + u * shape_m[i];
}

Vector3d sag_at(const ClampedBar& clamped, double x_m) {
  if (!clamped.sag) return Vector3d::Zero();
  const Vector3d g =
      (clamped.T_machine_planned * clamped.T_planned_bar).linear().transpose() * clamped.gravity;
  const auto& [height_y_m, height_z_m] = clamped.sag->section_yz_m;
  return {0.0, g.y() * sag_m(*clamped.sag, height_y_m, x_m),
          g.z() * sag_m(*clamped.sag, height_z_m, x_m)};
}

/// Form error of the target of the feature that is nearest to `p_m`.
double form_at(const ClampedBar& clamped, const Feature& feature, const Vector3d& p_m) {
  double nearest_m = std::numeric_limits<double>::infinity(), form_m = 0.0;
  for (std::size_t i = 0; i < clamped.all.size(); ++i) {
    const double away_m = (clamped.all[i].place_m - p_m).norm();
    if (!(clamped.all[i].feature == feature) || away_m >= nearest_m) continue;
    nearest_m = away_m;
    form_m = clamped.bar.form_m[i];
  }
  return form_m;
}

double most(const std::vector<double>& values) {
  double out = 0.0;
  for (const double v : values) out = std::max(out, std::abs(v));
  return out;
}

/// Computes distances of a tip from the features of one bar, in bar axes.
class Clearance {
 public:
  Clearance(const ClampedBar& clamped, const Vector3d& tip_m, double tip_radius_m)
      : clamped_(clamped), bar_(clamped.bar), tip_m_(tip_m), tip_radius_m_(tip_radius_m) {}

  [[nodiscard]] double nearest_m() {
    for (std::size_t i = 0; i < bar_.holes.size(); ++i) hole(i);
    for (std::size_t j = 0; j < bar_.rods.size(); ++j) {
      rod(j);
      for (const Side side : {Side::Left, Side::Right}) plane(j, side);
    }
    return nearest_m_;
  }

 private:
  /// Position of the tip relative to an axis: the distance along the axis, and the distance from
  /// it.
  struct FromAxis {
    double along_m, across_m;
  };
  [[nodiscard]] FromAxis from_axis(const TrueCylinder& c) const {
    const Vector3d from = tip_m_ - c.point_m;
    const double along_m = from.dot(c.direction);
    return {along_m, (from - along_m * c.direction).norm()};
  }

  void hole(std::size_t i) {
    constexpr double kInside = 1.5;  // in radii; a tip farther from the axis is not in this hole
    const TrueCylinder& c = bar_.holes[i];
    const FromAxis tip = from_axis(c);
    if (std::abs(tip.along_m) > 2.0 * most(bar_.pattern.hole_levels_m)) return;
    if (tip.across_m < kInside * c.radius_m) is({Kind::Hole, i, {}}, c.radius_m - tip.across_m);
  }

  void rod(std::size_t j) {
    const TrueCylinder& c = bar_.rods[j];
    const FromAxis tip = from_axis(c);
    if (std::abs(tip.along_m) <= 1.25 * most(bar_.pattern.rod_sections_m))
      is({Kind::Rod, j, {}}, tip.across_m - c.radius_m);
  }

  /// Adds the distance from a square that is touched from its outer side.
  void plane(std::size_t j, Side side) {
    const TruePlane& p = bar_.planes[j][static_cast<std::size_t>(side)];
    const double half_m =
        1.5 * std::max(most(bar_.pattern.plane_dx_m), most(bar_.pattern.plane_dz_m));
    const Vector3d from = tip_m_ - p.point_m;
    const double above_m = from.dot(p.normal);
    const Vector3d beside = (from - above_m * p.normal).cwiseAbs().array() - half_m;
    if (beside.maxCoeff() <= 0.0) is({Kind::Plane, j, side}, std::abs(above_m));
  }

  void is(const Feature& feature, double centre_away_m) {
    const double way_m = centre_away_m - tip_radius_m_;
    if (way_m >= nearest_m_) return;
    constexpr double kFormMatters_m = 1e-3;
    nearest_m_ = way_m;
    if (std::abs(way_m) < kFormMatters_m) nearest_m_ -= form_at(clamped_, feature, tip_m_);
  }

  const ClampedBar& clamped_;
  const TrueBar& bar_;
  Vector3d tip_m_;
  double tip_radius_m_;
  double nearest_m_ = std::numeric_limits<double>::infinity();
};

}  // namespace

Vector3d ClampedBar::displacement_m(double x_m) const {
  return sag_at(*this, x_m) + shape_at(*this, x_m);
}

ClampedBar clamped(const TrueBar& bar, std::span<const Measurement> plan, std::size_t m,
                   const ProbingOptions& options) {
  const std::size_t position = first_at_position(plan, m);
  ClampedBar out{.bar = bar, .all = targets(bar.pattern, plan[m].probed), .sag = options.sag};
  out.gravity = options.gravity.normalized();
  out.T_machine_planned = pose_of(plan[m], bar.pattern.length_m(), options, position);
  out.turned = how_turned(plan[m], options);
  if (out.turned) out.T_planned_bar = turned_pose(*out.turned, bar.pattern.length_m());
  set_temperature(out, options, position);
  set_shape(out, options, m);
  return out;
}

double clearance_m(const ClampedBar& clamped, const Vector3d& tip_m, double tip_radius_m) {
  const Vector3d there_m = (clamped.T_machine_planned * clamped.T_planned_bar).inverse() * tip_m;
  // Assumption: the bar is deformed at the centre of the tip as at the touched point, which is one
  // tip radius away.
  const Vector3d p_m =
      there_m - clamped.displacement_m(there_m.x()) - (clamped.growth - 1.0) * there_m;
  return Clearance(clamped, p_m, tip_radius_m).nearest_m();
}

}  // namespace abbe::sim::mfb
