#include "evemu/touch_site.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "abbe/calib/fit/plane.hpp"
#include "abbe/calib/fit/point_set.hpp"
#include "abbe/calib/fit/sphere.hpp"
#include "evemu/angle.hpp"

namespace abbe::calib::evemu {
namespace {

// A face spans this share of its length across, or it is a line and no face yet.
constexpr double kLeastWidth = 0.05;

std::vector<Vector3> without(const std::vector<Vector3>& points, std::size_t left_out) {
  std::vector<Vector3> rest = points;
  rest.erase(rest.begin() + static_cast<std::ptrdiff_t>(left_out));
  return rest;
}

double largest(const fit::ResidualStatistics& r) {
  return std::max(-r.min, r.max);
}

bool spans_a_face(const std::vector<Vector3>& points) {
  const auto set = fit::point_set(points, 3, "face");
  return set && set->singular_values(1) > kLeastWidth * set->singular_values(0);
}

/// The plane of a face that has points enough, sure or not.
std::optional<fit::Plane> likely_face(const std::vector<Vector3>& points, std::size_t least,
                                      double max_off_m) {
  if (points.size() < least || !spans_a_face(points)) return std::nullopt;
  const auto plane = fit::fit_plane(points, fit::point_set(points, 3, "face")->directions.col(2));
  if (!plane || largest(plane->residuals) > max_off_m) return std::nullopt;
  return *plane;
}

/// The plane, if it would stand without any one of its points.
std::optional<fit::Plane> sure_face(const std::vector<Vector3>& points, double max_off_m) {
  constexpr std::size_t kLeast = 5;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!spans_a_face(without(points, i))) return std::nullopt;
  }
  return likely_face(points, kLeast, max_off_m);
}

double spread_m(const std::vector<Vector3>& points, const Vector3& about_m) {
  double most = 0.0;
  for (const Vector3& p : points) most = std::max(most, (p - about_m).norm());
  return most;
}

}  // namespace

TouchedFeature feature_at(std::size_t order) {
  if (order == kBall1) return {Feature::Ball, 1};
  if (order <= kBlock2) return {Feature::Block, static_cast<int>(order)};
  return {Feature::Ball, static_cast<int>(order) - 1};
}

Site::Site(const Calibrator& calibrator, const GuideOptions& options, std::optional<Vector3> ball1_m)
    : calibrator_(calibrator),
      options_(options),
      ball1_m_(std::move(ball1_m)),
      points_(calibrator.balls.size() + 2) {}

double Site::radius_m(std::size_t feature) const {
  const auto ball = static_cast<std::size_t>(feature_at(feature).number) - 1;
  return calibrator_.balls[ball].radius_m + calibrator_.tip_radius_m;
}

double Site::extent_m() const {
  double most = 0.0;
  for (const auto& ball : calibrator_.balls)
    most = std::max(most, (ball.centre_m - calibrator_.balls.front().centre_m).norm());
  return most;
}

bool Site::has_point_near(std::size_t feature, const Vector3& p_m) const {
  return std::ranges::any_of(points_[feature],
                             [&](const Vector3& q) { return (p_m - q).norm() < options_.same_place_m; });
}

std::optional<std::size_t> Site::feature_of(const Vector3& p_m, std::size_t expected) {
  if (ball1_m_) {
    const double off_m = std::abs((p_m - *ball1_m_).norm() - radius_m(kBall1));
    if (off_m <= options_.observe.max_ball1_shift_m + options_.max_off_surface_m) return kBall1;
  } else {
    if (!near_first_ball(p_m)) return std::nullopt;
    return kBall1;
  }
  if (const auto face = face_of(p_m, expected)) return face;
  return ball_of(p_m);
}

/// Nothing is known yet: the touches of one ball are no farther apart than its diameter, or twice that of the
/// calibrator if it is another artefact's.
bool Site::near_first_ball(const Vector3& p_m) const {
  constexpr double kMostDiameters = 2.0;
  return std::ranges::all_of(points_[kBall1], [&](const Vector3& q) {
    return (p_m - q).norm() <= kMostDiameters * 2.0 * radius_m(kBall1);
  });
}

bool Site::on_face(std::size_t block, const Vector3& p_m) const {
  const auto face = sure_face(points_[block], options_.max_off_surface_m);
  if (!face) return false;
  constexpr double kBeyond_m = 20e-3;  // of the points there are: a face is a few centimetres large
  return std::abs((p_m - face->point).dot(face->normal)) <= options_.max_off_surface_m &&
         (p_m - face->point).norm() <= 2.0 * spread_m(points_[block], face->point) + kBeyond_m;
}

/// The calibrator says where faces look to, not where they are: what is no ball and expected on a face lies
/// on it until the face is known.
std::optional<std::size_t> Site::face_of(const Vector3& p_m, std::size_t expected) const {
  for (const std::size_t block : {kBlock1, kBlock2}) {
    if (on_face(block, p_m)) return block;
  }
  const bool ball1_lacks = points_[kBall1].size() < options_.observe.least_points_per_ball;
  if (expected > kBlock2 || (expected == kBall1 && ball1_lacks)) return std::nullopt;
  if ((p_m - *ball1_m_).norm() > extent_m()) return std::nullopt;
  for (std::size_t block = std::max(expected, kBlock1); block <= kBlock2; ++block) {
    if (!sure_face(points_[block], options_.max_off_surface_m)) return block;
  }
  return std::nullopt;
}

std::optional<std::size_t> Site::ball_of(const Vector3& p_m) {
  std::size_t ball = 0;
  if (nearest_ball_m(p_m, ball) > options_.max_off_expected_m) return std::nullopt;
  const auto contradicts = [&](const std::vector<Vector3>& centres) {
    const double off_m =
        std::abs((p_m - centres[ball]).norm() - calibrator_.balls[ball].radius_m - calibrator_.tip_radius_m);
    return off_m > options_.max_off_expected_m;
  };
  std::erase_if(candidates_, contradicts);
  return ball + 2;
}

double Site::nearest_ball_m(const Vector3& p_m, std::size_t& ball) const {
  double nearest = std::numeric_limits<double>::infinity();
  for (const auto& centres : candidates_) {
    for (std::size_t i = 1; i < centres.size(); ++i) {
      const double radius = calibrator_.balls[i].radius_m + calibrator_.tip_radius_m;
      const double off_m = std::abs((p_m - centres[i]).norm() - radius);
      if (off_m >= nearest) continue;
      nearest = off_m;
      ball = i;
    }
  }
  return nearest;
}

void Site::add(std::size_t feature, const Vector3& p_m) {
  points_[feature].push_back(p_m);
  if (feature == kBall1) {
    const FeatureCheck seen = check(kBall1);
    if (seen.fine && points_[kBall1].size() >= options_.observe.least_points_per_ball)
      ball1_m_ = fit::fit_sphere(points_[kBall1])->centre;
  }
  if (feature <= kBlock2) place_balls();
}

void Site::drop(std::size_t feature, std::size_t point) {
  points_[feature] = without(points_[feature], point);
  if (feature <= kBlock2) place_balls();
}

void Site::clear(std::size_t feature) {
  points_[feature].clear();
  if (feature <= kBlock2) place_balls();
}

void Site::place_balls() {
  candidates_.clear();
  const auto face = [this](std::size_t block) {
    return likely_face(points_[block], options_.observe.least_points_per_block, options_.max_off_surface_m);
  };
  const auto n1 = face(kBlock1), n2 = face(kBlock2);
  if (!ball1_m_ || !n1 || !n2) return;
  const auto& c = calibrator_;
  const RigidTransform T_pre_uni =
      *uniform_frame(c.balls.front().centre_m, c.blocks[0].normal, c.blocks[1].normal);
  for (const double side_1 : {1.0, -1.0}) {
    for (const double side_2 : {1.0, -1.0}) {
      const auto T_self_uni = uniform_frame(*ball1_m_, side_1 * n1->normal, side_2 * n2->normal);
      if (!T_self_uni) return;
      auto& centres = candidates_.emplace_back();
      for (const auto& ball : c.balls)
        centres.push_back(*T_self_uni * (T_pre_uni.R.transpose() * (ball.centre_m - T_pre_uni.t_m)));
    }
  }
}

FeatureCheck Site::check(std::size_t feature) const {
  return feature_at(feature).feature == Feature::Ball ? check_ball(feature) : check_face(feature);
}

FeatureCheck Site::check_ball(std::size_t feature) const {
  const std::vector<Vector3>& points = points_[feature];
  const auto fits = [&](const fit::Sphere& s) {
    return std::abs(s.radius - radius_m(feature)) <= options_.observe.max_radius_mismatch_m &&
           largest(s.residuals) <= options_.max_off_surface_m;
  };
  const auto sphere = fit::fit_sphere(points);
  if (sphere && fits(*sphere)) return {.fine = true};
  FeatureCheck found;
  // One sphere, with more points than it needs, but of another size.
  if (sphere && points.size() > options_.observe.least_points_per_ball &&
      largest(sphere->residuals) <= options_.max_off_surface_m)
    found.other_radius_m = sphere->radius;
  for (std::size_t i = 0; i < points.size() && !found.other_radius_m; ++i) {
    const auto rest = fit::fit_sphere(without(points, i));
    if (!rest || !fits(*rest)) continue;
    const double off_m = std::abs((points[i] - rest->centre).norm() - rest->radius);
    if (off_m > found.off_m) found = {.outlier = i, .off_m = off_m};
  }
  return found;
}

FeatureCheck Site::check_face(std::size_t feature) const {
  const std::vector<Vector3>& points = points_[feature];
  const auto face_of_some = [this](const std::vector<Vector3>& some) {
    return likely_face(some, 3, options_.max_off_surface_m);
  };
  if (face_of_some(points)) return {.fine = true};
  FeatureCheck found;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto rest = face_of_some(without(points, i));
    if (!rest) continue;
    const double off_m = std::abs((points[i] - rest->point).dot(rest->normal));
    if (off_m > found.off_m) found = {.outlier = i, .off_m = off_m};
  }
  return found;
}

double Site::faces_off_rad() const {
  std::array<Vector3, 2> normal;
  for (const std::size_t block : {kBlock1, kBlock2}) {
    const auto set = fit::point_set(points_[block], 3, "face");
    if (!set) return std::numbers::pi;
    normal[block - 1] = set->directions.col(2);
  }
  const double nominal = line_angle_rad(calibrator_.blocks[0].normal, calibrator_.blocks[1].normal);
  return std::abs(line_angle_rad(normal[0], normal[1]) - nominal);
}

std::vector<Touch> Site::touches(int position) const {
  std::vector<Touch> all;
  for (std::size_t f = 0; f < points_.size(); ++f) {
    const auto [feature, number] = feature_at(f);
    for (const Vector3& p : points_[f]) all.push_back({position, feature, number, p});
  }
  return all;
}

}  // namespace abbe::calib::evemu
