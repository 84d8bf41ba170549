#include "abbe/sim/mfb/true_bar.hpp"

#include <Eigen/Dense>
#include <cmath>
#include <span>

#include "abbe/sim/noise.hpp"

namespace abbe::sim::mfb {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// Draws the deviations of one bar. Each call takes the next random number of the seed.
class Draw {
 public:
  explicit Draw(std::uint64_t seed) : seed_(seed) {}
  double number(double sd) { return sd * gaussian(seed_, NoiseStream::Bar, next_++); }
  Vector3d vector(double sd) {
    const double x = number(sd), y = number(sd), z = number(sd);
    return {x, y, z};
  }
  Vector3d tilted(const Vector3d& direction, double sd_rad) {
    return (direction + vector(sd_rad)).normalized();
  }

 private:
  std::uint64_t seed_;
  std::uint64_t next_ = 0;
};

/// The shape of a bow: 1 in the middle of the bar, 0 at hole 1 and hole N.
double bow_at(const Pattern& pattern, double x_m) {
  const double u = 2.0 * x_m / pattern.length_m() - 1.0;
  return 1.0 - u * u;
}

/// Form errors of the touches of one feature, without the part that would displace, rotate or
/// enlarge the feature.
Eigen::VectorXd form_of(std::span<const Target> touches, double sd_m, Draw& draw) {
  const auto n = static_cast<Eigen::Index>(touches.size());
  Vector3d centre_m = Vector3d::Zero();
  for (const Target& t : touches) centre_m += t.place_m / static_cast<double>(n);

  constexpr double kBarSize_m = 0.01;  // scales displacements and rotations to similar magnitudes
  Eigen::Matrix<double, Eigen::Dynamic, 7> seen(n, 7);
  Eigen::VectorXd form(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Target& t = touches[static_cast<std::size_t>(i)];
    const Vector3d turned = (t.place_m - centre_m).cross(t.normal) / kBarSize_m;
    seen.row(i) << t.normal.transpose(), turned.transpose(), 1.0;
    form[i] = draw.number(sd_m);
  }
  const Eigen::MatrixXd columns = seen;
  return form - columns * columns.completeOrthogonalDecomposition().solve(form);
}

void draw_form(TrueBar& bar, double sd_m, Draw& draw) {
  const std::vector<Target> all = targets(bar.pattern);
  bar.form_m.clear();
  for (std::size_t first = 0; first < all.size();) {
    std::size_t last = first + 1;
    while (last < all.size() && all[last].feature == all[first].feature) ++last;
    const Eigen::VectorXd form = form_of(std::span(all).subspan(first, last - first), sd_m, draw);
    bar.form_m.insert(bar.form_m.end(), form.begin(), form.end());
    first = last;
  }
}

void draw_features(TrueBar& bar, const BarDeviations& sd, Draw& draw) {
  const Pattern& pattern = bar.pattern;
  const double bow_y_m = draw.number(sd.bow_m), bow_z_m = draw.number(sd.bow_m);
  double pitch_error_m = 0.0;
  for (std::size_t i = 0; i < pattern.hole_x_m.size(); ++i) {
    const double x_m = pattern.hole_x_m[i], y_m = pattern.hole_y_m[i];
    const Vector3d place_m(x_m + pitch_error_m, y_m + bow_y_m * bow_at(pattern, x_m), 0.0);
    bar.holes.push_back({place_m + draw.vector(sd.position_m),
                         draw.tilted(Vector3d::UnitZ(), sd.tilt_rad),
                         pattern.hole_radius_m + draw.number(sd.radius_m)});
    pitch_error_m += draw.number(sd.pitch_m);
  }

  for (const double x_m : pattern.rod_x_m) {
    const Vector3d place_m(x_m, 0.0, bow_z_m * bow_at(pattern, x_m));
    bar.rods.push_back({place_m + draw.vector(sd.position_m),
                        draw.tilted(Vector3d::UnitY(), sd.tilt_rad),
                        pattern.rod_radius_m + draw.number(sd.radius_m)});
    auto& pair = bar.planes.emplace_back();
    for (const double sign : {1.0, -1.0}) {
      const Vector3d at_m(x_m, sign * pattern.plane_y_m, 0.0);
      pair[sign > 0.0 ? 0 : 1] = {at_m + draw.vector(sd.position_m),
                                  draw.tilted(sign * Vector3d::UnitY(), sd.tilt_rad)};
    }
  }
}

Vector3d meeting_point(const TrueCylinder& axis, const TruePlane& plane) {
  const Vector3d& d = axis.direction;
  return axis.point_m + d * (plane.normal.dot(plane.point_m - axis.point_m) / plane.normal.dot(d));
}

/// Least-squares plane of four points; the normal points to +z.
TruePlane plane_of(const std::array<Vector3d, 4>& points_m) {
  const Vector3d centre_m = 0.25 * (points_m[0] + points_m[1] + points_m[2] + points_m[3]);
  Eigen::Matrix<double, 4, 3> centred;
  for (Eigen::Index i = 0; i < 4; ++i)
    centred.row(i) = (points_m[static_cast<std::size_t>(i)] - centre_m).transpose();
  const Eigen::JacobiSVD<Eigen::Matrix<double, 4, 3>> svd(centred, Eigen::ComputeFullV);
  const Vector3d normal = svd.matrixV().col(2);
  return {centre_m, normal.z() < 0.0 ? Vector3d(-normal) : normal};
}

/// The points of interest and the axes of the bar frame, in the frame of the features.
struct Extraction {
  std::vector<Vector3d> O_m;
  Matrix3d axes = Matrix3d::Identity();  ///< x, y, z of R_MFB as columns
};

Extraction extract(const TrueBar& bar) {
  std::vector<std::array<Vector3d, 2>> ends;
  for (std::size_t j = 0; j < bar.rods.size(); ++j)
    ends.push_back({meeting_point(bar.rods[j], bar.planes[j][0]),
                    meeting_point(bar.rods[j], bar.planes[j][1])});

  const auto &first = ends.front(), &last = ends.back();
  const TruePlane reference = plane_of({first[0], first[1], last[0], last[1]});
  Extraction found;
  for (std::size_t i = 0; i < bar.holes.size(); ++i) {
    const bool at_end = i == 0 || i + 1 == bar.holes.size();
    const TruePlane plane =
        at_end ? reference : plane_of({ends[i - 1][0], ends[i - 1][1], ends[i][0], ends[i][1]});
    found.O_m.push_back(meeting_point(bar.holes[i], plane));
  }

  const Vector3d x = (found.O_m.back() - found.O_m.front()).normalized();
  found.axes << x, reference.normal.cross(x), reference.normal;
  return found;
}

/// Transforms the bar into its own frame R_MFB.
void move_into_own_frame(TrueBar& bar) {
  const Extraction found = extract(bar);
  const Vector3d origin_m = found.O_m.front();
  const auto moved = [&](Vector3d& point_m, Vector3d& direction) {
    point_m = found.axes.transpose() * (point_m - origin_m);
    direction = found.axes.transpose() * direction;
  };
  for (TrueCylinder& hole : bar.holes) moved(hole.point_m, hole.direction);
  for (TrueCylinder& rod : bar.rods) moved(rod.point_m, rod.direction);
  for (auto& pair : bar.planes)
    for (TruePlane& plane : pair) moved(plane.point_m, plane.normal);
}

/// Distance of the tip's centre from the nominal place, along `target.normal`, when the tip touches
/// the cylinder. Equation: |s n + w| = distance of the centre from the axis, in the plane
/// perpendicular to the axis.
double way_to_cylinder_m(const TrueCylinder& c, const Target& target, double distance_m,
                         double expected_m) {
  const auto across = [&](const Vector3d& v) {
    return Vector3d(v - v.dot(c.direction) * c.direction);
  };
  const Vector3d n = across(target.normal), w = across(target.place_m - c.point_m);
  const double b = n.dot(w) / n.squaredNorm();
  const double root =
      std::sqrt(b * b - (w.squaredNorm() - distance_m * distance_m) / n.squaredNorm());
  return std::abs(-b + root - expected_m) < std::abs(-b - root - expected_m) ? -b + root
                                                                             : -b - root;
}

}  // namespace

TrueBar random_bar(const Pattern& pattern, const BarDeviations& deviations) {
  Draw draw(deviations.seed);
  TrueBar bar{.pattern = pattern};
  draw_features(bar, deviations, draw);
  move_into_own_frame(bar);
  draw_form(bar, deviations.form_m, draw);
  return bar;
}

std::vector<Vector3d> points_of_interest_m(const TrueBar& bar) {
  const Extraction found = extract(bar);
  std::vector<Vector3d> O_m;
  for (const Vector3d& point_m : found.O_m)
    O_m.emplace_back(found.axes.transpose() * (point_m - found.O_m.front()));
  return O_m;
}

Contact contact(const TrueBar& bar, const Target& target, std::size_t number, double tip_radius_m) {
  const Feature& f = target.feature;
  const Vector3d& n = target.normal;
  double way_m = 0.0;  // distance from the nominal place to the centre of the tip
  Vector3d surface_normal = n;
  const auto around = [&](const TrueCylinder& c, double distance_m) {
    way_m = way_to_cylinder_m(c, target, distance_m, tip_radius_m);
    const Vector3d from_axis = target.place_m + way_m * n - c.point_m;
    const Vector3d radial = (from_axis - from_axis.dot(c.direction) * c.direction).normalized();
    surface_normal = f.kind == Kind::Hole ? Vector3d(-radial) : radial;
  };

  if (f.kind == Kind::Hole) {
    around(bar.holes[f.index], bar.holes[f.index].radius_m - tip_radius_m);
  } else if (f.kind == Kind::Rod) {
    around(bar.rods[f.index], bar.rods[f.index].radius_m + tip_radius_m);
  } else {
    const TruePlane& p = bar.planes[f.index][static_cast<std::size_t>(f.side)];
    way_m = (tip_radius_m - p.normal.dot(target.place_m - p.point_m)) / p.normal.dot(n);
    surface_normal = p.normal;
  }

  const Vector3d centre_m = target.place_m + (way_m + bar.form_m[number]) * n;
  return {centre_m, centre_m - tip_radius_m * surface_normal};
}

}  // namespace abbe::sim::mfb
