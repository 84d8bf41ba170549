#include "live/touch_site.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "abbe/calib/fit/plane.hpp"
#include "abbe/calib/fit/sphere.hpp"
#include "abbe/calib/internal/fit/point_set.hpp"
#include "run/angle.hpp"

namespace abbe::calib::evemu {
namespace {

// Smallest ratio of width to length of the points on a face; narrower points form a line.
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

/// The plane of a face with at least `least` points; nullopt with fewer points or if they do not
/// lie in a plane. A single wrong point may have changed the plane.
std::optional<fit::Plane> likely_face(const std::vector<Vector3>& points, std::size_t least,
                                      double max_off_m) {
  if (points.size() < least || !spans_a_face(points)) return std::nullopt;
  const auto plane = fit::fit_plane(points, fit::point_set(points, 3, "face")->directions.col(2));
  if (!plane || largest(plane->residuals) > max_off_m) return std::nullopt;
  return *plane;
}

/// The plane of a face with at least five points; nullopt if there is a point without which the
/// other points do not span a plane.
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

Site::Site(const Calibrator& calibrator, const GuideOptions& options, const Site* before)
    : calibrator_(calibrator),
      options_(options),
      points_(calibrator.balls.size() + 2),
      accepted_(calibrator.balls.size() + 2, false) {
  if (before == nullptr) return;
  ball1_m_ = before->ball1_m_;
  sides_ = before->sides_;
}

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
  return std::ranges::any_of(
      points_[feature], [&](const Vector3& q) { return (p_m - q).norm() < options_.same_place_m; });
}

std::optional<std::size_t> Site::feature_of(const Vector3& p_m, std::size_t expected) const {
  if (ball1_m_) {
    const double off_m = std::abs((p_m - *ball1_m_).norm() - radius_m(kBall1));
    if (off_m <= options_.observe.max_ball1_shift_m + options_.observe.max_off_surface_m)
      return kBall1;
  } else {
    if (!near_first_ball(p_m)) return std::nullopt;
    return kBall1;
  }
  if (const auto face = face_of(p_m, expected)) return face;
  return ball_of(p_m, expected);
}

/// True if the point may be on the ball touched first. Used while the place of no feature is known.
/// Touches of one ball are at most one diameter apart; twice the diameter in the calibrator is
/// accepted, so that all touches of a larger ball of another artefact are collected and its radius
/// is computed and reported.
bool Site::near_first_ball(const Vector3& p_m) const {
  constexpr double kMostDiameters = 2.0;
  return std::ranges::all_of(points_[kBall1], [&](const Vector3& q) {
    return (p_m - q).norm() <= kMostDiameters * 2.0 * radius_m(kBall1);
  });
}

bool Site::on_face(std::size_t block, const Vector3& p_m) const {
  const auto face = sure_face(points_[block], options_.observe.max_off_surface_m);
  if (!face) return false;
  constexpr double kBeyond_m = 20e-3;  // permitted distance beyond the known points: a face
                                       // measures only a few centimetres
  return std::abs((p_m - face->point).dot(face->normal)) <= options_.observe.max_off_surface_m &&
         (p_m - face->point).norm() <= 2.0 * spread_m(points_[block], face->point) + kBeyond_m;
}

/// The face on which the point lies; nullopt if it lies on none. The calibrator states the
/// directions of the faces, not their places. Until the place of a face is known, a touch that is
/// not on Ball1 is assigned to the face if the face is `expected`.
std::optional<std::size_t> Site::face_of(const Vector3& p_m, std::size_t expected) const {
  for (const std::size_t block : {kBlock1, kBlock2}) {
    if (on_face(block, p_m)) return block;
  }

  const bool ball1_lacks = points_[kBall1].size() < options_.observe.least_points_per_ball;
  const bool balls_known = !candidates_.empty();
  if ((expected > kBlock2 && balls_known) || (expected == kBall1 && ball1_lacks))
    return std::nullopt;
  if ((p_m - *ball1_m_).norm() > extent_m()) return std::nullopt;
  const std::size_t first = expected > kBlock2 ? kBlock1 : std::max(expected, kBlock1);

  for (std::size_t block = first; block <= kBlock2; ++block) {
    if (!sure_face(points_[block], options_.observe.max_off_surface_m)) return block;
  }

  return std::nullopt;
}

/// The ball on which the point lies; nullopt if it lies on none. The expected ball is tested first,
/// because the place of one ball under one assumption about the sides of the faces (Candidate) may
/// be the place of another ball under another assumption.
std::optional<std::size_t> Site::ball_of(const Vector3& p_m, std::size_t expected) const {
  for (const Candidate& candidate : candidates_) {
    const std::size_t ball = nearest_ball(candidate, p_m);
    if (ball + 2 == expected && off_ball_m(candidate, ball, p_m) <= options_.max_off_expected_m)
      return expected;
  }
  std::size_t ball = 0;
  if (nearest_ball_m(p_m, ball) > options_.max_off_expected_m) return std::nullopt;
  return ball + 2;
}

double Site::off_ball_m(const Candidate& candidate, std::size_t ball, const Vector3& p_m) const {
  const double radius = calibrator_.balls[ball].radius_m + calibrator_.tip_radius_m;
  return std::abs((p_m - candidate.centres_m[ball]).norm() - radius);
}

std::size_t Site::nearest_ball(const Candidate& candidate, const Vector3& p_m) const {
  std::size_t nearest = 1;
  for (std::size_t i = 2; i < candidate.centres_m.size(); ++i) {
    if (off_ball_m(candidate, i, p_m) < off_ball_m(candidate, nearest, p_m)) nearest = i;
  }
  return nearest;
}

double Site::nearest_ball_m(const Vector3& p_m, std::size_t& ball) const {
  double nearest = std::numeric_limits<double>::infinity();
  for (const Candidate& candidate : candidates_) {
    const std::size_t i = nearest_ball(candidate, p_m);
    const double off_m = off_ball_m(candidate, i, p_m);
    if (off_m >= nearest) continue;
    nearest = off_m;
    ball = i;
  }
  return nearest;
}

/// Removes the candidates (assumptions about the sides of the faces) that do not agree with an
/// accepted ball. Only accepted balls are used, so that a stray touch cannot remove a candidate.
void Site::rule_out_by(std::size_t feature) {
  const auto agrees = [&](const Candidate& candidate) {
    return std::ranges::all_of(points_[feature], [&](const Vector3& p) {
      return off_ball_m(candidate, feature - 2, p) <= options_.max_off_expected_m;
    });
  };
  if (std::ranges::any_of(candidates_, agrees)) std::erase_if(candidates_, std::not_fn(agrees));
}

std::size_t Site::accept_ball(std::size_t feature) {
  accepted_[feature] = true;
  rule_out_by(feature);
  std::size_t dropped = 0;
  for (std::size_t f = kBlock2 + 1; f < points_.size() && !candidates_.empty(); ++f) {
    if (accepted_[f]) continue;
    dropped += std::erase_if(points_[f], [&](const Vector3& p) {
      return std::ranges::none_of(candidates_, [&](const Candidate& candidate) {
        return off_ball_m(candidate, f - 2, p) <= options_.max_off_expected_m;
      });
    });
  }
  return dropped;
}

void Site::add(std::size_t feature, const Vector3& p_m) {
  points_[feature].push_back(p_m);
  if (feature == kBall1) {
    const FeatureCheck seen = check(kBall1);
    if (seen.valid && points_[kBall1].size() >= options_.observe.least_points_per_ball) {
      ball1_m_ = fit::fit_sphere(points_[kBall1])->centre;
      ball1_measured_ = true;
    }
  }
  if (feature <= kBlock2) place_balls();
}

void Site::drop(std::size_t feature, std::size_t point) {
  points_[feature] = without(points_[feature], point);
  if (feature <= kBlock2) place_balls();
}

void Site::clear(std::size_t feature) {
  points_[feature].clear();
  accepted_[feature] = false;
  if (feature == kBall1) ball1_measured_ = false;
  if (feature <= kBlock2) place_balls();
}

std::optional<fit::Plane> Site::face(std::size_t block) const {
  auto plane = likely_face(points_[block], options_.observe.least_points_per_block,
                           options_.observe.max_off_surface_m);
  if (plane && (plane->point - *ball1_m_).dot(plane->normal) < 0.0) plane->normal = -plane->normal;
  return plane;
}

/// True if Ball1 is so far from the plane of the face that machine errors cannot move it to the
/// other side.
bool Site::is_sided(const fit::Plane& face) const {
  return (face.point - *ball1_m_).dot(face.normal) > 2.0 * options_.max_off_expected_m;
}

/// Centre of a ball. While several assumptions about the sides of the faces are possible, it is
/// known only if all of them give the same place. For Ball1 they always do.
std::optional<Vector3> Site::centre_m(std::size_t ball) const {
  if (ball == 0) return ball1_measured_ ? ball1_m_ : std::nullopt;
  if (candidates_.empty()) return std::nullopt;
  const Vector3& first_m = candidates_.front().centres_m[ball];
  const bool agree = std::ranges::all_of(candidates_, [&](const Candidate& candidate) {
    return (candidate.centres_m[ball] - first_m).norm() <= options_.max_off_expected_m;
  });
  return agree ? std::optional(first_m) : std::nullopt;
}

/// Normal of a block. While several assumptions about the sides of the faces are possible, it is
/// known only if all of them give the same side.
std::optional<Vector3> Site::normal(std::size_t block) const {
  const auto plane = face(block);
  if (!plane || candidates_.empty()) return std::nullopt;
  const double side = candidates_.front().side[block - 1];
  const bool agree = std::ranges::all_of(
      candidates_, [&](const Candidate& candidate) { return candidate.side[block - 1] == side; });
  return agree ? std::optional<Vector3>(side * plane->normal) : std::nullopt;
}

std::vector<double> Site::possible_sides(std::size_t block, const fit::Plane& face) const {
  const auto& known = sides_[block - 1];
  return known && is_sided(face) ? std::vector{*known} : std::vector{1.0, -1.0};
}

void Site::place_balls() {
  candidates_.clear();
  if (!ball1_m_) return;
  const auto n1 = face(kBlock1), n2 = face(kBlock2);
  if (!n1 || !n2) return;
  const auto& c = calibrator_;
  const RigidTransform T_pre_uni =
      *uniform_frame(c.balls.front().centre_m, c.blocks[0].normal, c.blocks[1].normal);

  for (const double side_1 : possible_sides(kBlock1, *n1)) {
    for (const double side_2 : possible_sides(kBlock2, *n2)) {
      const auto T_self_uni = uniform_frame(*ball1_m_, side_1 * n1->normal, side_2 * n2->normal);
      if (!T_self_uni) return;
      auto& candidate =
          candidates_.emplace_back(Candidate{.side = {side_1, side_2}, .centres_m = {}});
      for (const auto& ball : c.balls)
        candidate.centres_m.push_back(*T_self_uni *
                                      (T_pre_uni.R.transpose() * (ball.centre_m - T_pre_uni.t_m)));
    }
  }

  for (std::size_t f = kBlock2 + 1; f < points_.size(); ++f) {
    if (accepted_[f]) rule_out_by(f);
  }
}

/// Stores on which side of each face Ball1 lies. The artefact is rigid, so that the side is the
/// same at every position.
void Site::keep_sides() {
  if (candidates_.empty()) return;
  for (const std::size_t block : {kBlock1, kBlock2}) {
    const auto side_of = [block](const Candidate& candidate) { return candidate.side[block - 1]; };
    const double side = side_of(candidates_.front());
    const auto plane = face(block);
    const bool agreed =
        std::ranges::all_of(candidates_, [&](const auto& c) { return side_of(c) == side; });
    if (agreed && plane && is_sided(*plane)) sides_[block - 1] = side;
  }
}

FeatureCheck Site::check(std::size_t feature) const {
  return feature_at(feature).feature == Feature::Ball ? check_ball(feature) : check_face(feature);
}

FeatureCheck Site::check_ball(std::size_t feature) const {
  const std::vector<Vector3>& points = points_[feature];
  const auto fits = [&](const fit::Sphere& s) {
    return std::abs(s.radius - radius_m(feature)) <= options_.observe.max_radius_mismatch_m &&
           largest(s.residuals) <= options_.observe.max_off_surface_m;
  };

  const auto sphere = fit::fit_sphere(points);
  if (sphere && fits(*sphere)) return {.valid = true};
  FeatureCheck found;

  // If more points than necessary lie on one sphere, but its radius is not that of the calibrator,
  // the radius is reported.
  if (sphere && points.size() > options_.observe.least_points_per_ball &&
      largest(sphere->residuals) <= options_.observe.max_off_surface_m)
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
    return likely_face(some, 3, options_.observe.max_off_surface_m);
  };

  if (face_of_some(points)) return {.valid = true};
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
