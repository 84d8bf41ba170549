#include "abbe/calib/evemu/plan/artefact_touches.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/statistics/elementary.hpp"
#include "abbe/calib/statistics/root_sum_of_squares.hpp"

namespace abbe::calib::evemu {
namespace {

constexpr std::size_t kLeastBallPoints = 5;
constexpr std::size_t kLeastFacePoints = 4;
constexpr double kRingUpper_rad = 45.0 * std::numbers::pi / 180.0;
constexpr double kRingLower_rad = 80.0 * std::numbers::pi / 180.0;
constexpr double kOuter = 1.6;                // distance of the tip from a ball's centre / that in
                                              // contact
constexpr double kCosOfFarthestAround = 0.5;  // 60 degrees: largest angle of a free straight path
                                              // around a ball

Vector3 across(const Vector3& up) {
  return up.unitOrthogonal();
}

/// Directions of the touches on a ball: the pole, then the points of two rings in order around the
/// ball. The lower ring is rotated by half a step: if it were not, two points on each ring and the
/// pole would lie in one plane and not determine a sphere.
std::vector<Vector3> normals_on_a_ball(const Vector3& up, std::size_t points) {
  const Vector3 x = across(up), y = up.cross(x);
  std::vector<Vector3> normals{up};
  const std::size_t lower = points / 2;
  const std::size_t upper = points - 1 - lower;

  struct Ring {
    double polar_rad;
    std::size_t points;
    double first_step;
  };

  for (const auto& [polar_rad, n, first] :
       {Ring{kRingUpper_rad, upper, 0.0}, Ring{kRingLower_rad, lower, 0.5}}) {
    const SinCos polar = sin_cos(polar_rad);
    for (std::size_t i = 0; i < n; ++i) {
      const SinCos around = sin_cos(2.0 * std::numbers::pi * (first + static_cast<double>(i)) /
                                    static_cast<double>(n));
      normals.push_back(polar.cos * up + polar.sin * (around.cos * x + around.sin * y));
    }
  }

  return normals;
}

/// Points on a circle around the centre of the face, then the centre.
std::vector<Vector3> places_on_a_face(const FaceToTouch& face, const Vector3& normal,
                                      std::size_t points) {
  const Vector3 x = across(normal), y = normal.cross(x);
  std::vector<Vector3> places;
  for (std::size_t i = 0; i + 1 < points; ++i) {
    const SinCos around =
        sin_cos(2.0 * std::numbers::pi * static_cast<double>(i) / static_cast<double>(points - 1));
    places.push_back(face.centre_m + face.half_size_m * (around.cos * x + around.sin * y));
  }
  places.push_back(face.centre_m);
  return places;
}

class Planner {
 public:
  Planner(const Calibrator& nominal, const std::array<FaceToTouch, 2>& faces, const Vector3& from_m,
          const ArtefactTouchOptions& options)
      : nominal_(nominal),
        options_(options),
        up_(nominal.blocks[0].normal.normalized()),
        here_(from_m) {
    for (const auto& ball : nominal.balls)
      top_m_ = std::max(top_m_, up_.dot(ball.centre_m) + kOuter * reach(ball));
    for (const auto& face : faces)
      top_m_ = std::max(top_m_, up_.dot(face.centre_m) + face.half_size_m + nominal.tip_radius_m);
    top_m_ += options.clearance_m;
  }

  /// The ball with which the tip would collide on a straight path up from its position; null: none.
  [[nodiscard]] const Calibrator::Ball* ball_above() const {
    const auto above = [this](const Calibrator::Ball& ball) {
      const Vector3 from_centre = here_ - ball.centre_m;
      const double height = up_.dot(from_centre);
      return height < 0.0 &&
             (from_centre - height * up_).norm() < reach(ball) + options_.clearance_m;
    };
    const auto found = std::ranges::find_if(nominal_.balls, above);
    return found == nominal_.balls.end() ? nullptr : &*found;
  }

  void touch(const Calibrator::Ball& ball) {
    const auto normals = normals_on_a_ball(up_, options_.points_per_ball);
    Vector3 before = up_;

    for (std::size_t i = 0; i < normals.size(); ++i) {
      const Vector3& n = normals[i];
      const Vector3 outer = ball.centre_m + kOuter * reach(ball) * n;
      std::vector<Vector3> way;
      if (i == 0) {
        way = over_to(outer);
      } else {
        way.push_back(ball.centre_m + kOuter * reach(ball) * before);
        if (before.dot(n) < kCosOfFarthestAround) go_over(ball, way, n);
        way.push_back(outer);
      }

      planned_.push_back(
          {{std::move(way), ball.centre_m + reach(ball) * n, n}, Feature::Ball, ball.number});
      before = n;
      here_ = outer;
    }
  }

  void touch(const Calibrator::Block& block, const FaceToTouch& face) {
    const Vector3 n = block.normal.normalized();
    bool first = true;
    for (const Vector3& place : places_on_a_face(face, n, options_.points_per_face)) {
      const Vector3 at = place + nominal_.tip_radius_m * n;
      const Vector3 outer = at + options_.clearance_m * n;
      auto way = std::exchange(first, false) ? over_to(outer) : std::vector<Vector3>{here_, outer};
      planned_.push_back({{std::move(way), at, n}, Feature::Block, block.number});
      here_ = outer;
    }
  }

  [[nodiscard]] ArtefactPlan planned() { return {std::move(planned_), {here_, raised(here_)}}; }

 private:
  [[nodiscard]] double reach(const Calibrator::Ball& ball) const {
    return ball.radius_m + nominal_.tip_radius_m;
  }
  [[nodiscard]] bool high(const Vector3& p_m) const { return up_.dot(p_m) >= top_m_; }
  [[nodiscard]] Vector3 raised(const Vector3& p_m) const {
    return p_m + (top_m_ - up_.dot(p_m)) * up_;
  }
  /// Path to a place: up, across, down. The step up is left out if the tip is already above all
  /// features.
  [[nodiscard]] std::vector<Vector3> over_to(const Vector3& place_m) const {
    std::vector<Vector3> way;
    if (!planned_.empty())
      way.push_back(here_);  // back from the contact of the last touch to its
                             // approach point
    if (!high(here_)) way.push_back(raised(here_));
    way.push_back(raised(place_m));
    way.push_back(place_m);
    return way;
  }
  /// Path around a ball over its pole, with three corner points: the angle from a point of a ring
  /// to the pole may exceed 60 degrees, the largest angle at which a straight path is free of
  /// collision.
  void go_over(const Calibrator::Ball& ball, std::vector<Vector3>& way, const Vector3& to) const {
    const double outer = kOuter * reach(ball);
    const Vector3 from = (way.back() - ball.centre_m).normalized();
    way.push_back(ball.centre_m + outer * (from + up_).normalized());
    way.push_back(ball.centre_m + outer * up_);
    way.push_back(ball.centre_m + outer * (to + up_).normalized());
  }

  const Calibrator& nominal_;
  const ArtefactTouchOptions& options_;
  Vector3 up_;
  double top_m_ = -std::numeric_limits<double>::infinity();
  Vector3 here_;  ///< start of the path to the next touch
  std::vector<PlannedTouch> planned_;
};

}  // namespace

Result<ArtefactPlan> plan_artefact_touches(const Calibrator& nominal,
                                           const std::array<FaceToTouch, 2>& faces,
                                           const Vector3& from_m,
                                           const ArtefactTouchOptions& options) {
  if (const auto sound = check(nominal); !sound)
    return failure(sound.error().code, sound.error().text);
  if (options.points_per_ball < kLeastBallPoints || options.points_per_face < kLeastFacePoints) {
    return failure(ErrorCode::BadInput,
                   message("touches of an artefact: at least ", kLeastBallPoints, " on a ball and ",
                           kLeastFacePoints, " on a face"));
  }

  Planner planner(nominal, faces, from_m, options);
  if (const auto* ball = planner.ball_above()) {
    return failure(ErrorCode::BadInput,
                   message("touches of an artefact: ball ", ball->number,
                           " is above the tip: move the tip up beside it first"));
  }

  for (const auto& ball : nominal.balls) planner.touch(ball);
  for (std::size_t i = 0; i < faces.size(); ++i) planner.touch(nominal.blocks[i], faces[i]);
  return planner.planned();
}

Calibrator moved(const Calibrator& calibrator, const RigidTransform& T_machine_artefact) {
  Calibrator out = calibrator;
  for (auto& ball : out.balls)
    ball.centre_m = T_machine_artefact.R * ball.centre_m + T_machine_artefact.t_m;
  for (auto& block : out.blocks) block.normal = T_machine_artefact.R * block.normal;
  return out;
}

Result<Calibrator> calibrated_artefact(const Calibrator& nominal,
                                       const std::array<FaceToTouch, 2>& faces,
                                       std::span<const Touch> touches, double u_position_m) {
  auto found = precalibrated(nominal.name, touches, nominal.tip_radius_m,
                             {nominal.blocks[0].normal, nominal.blocks[1].normal}, u_position_m);
  if (!found) return found;
  found->expansivity = nominal.expansivity;
  for (auto& ball : found->balls) ball.u_m = root_sum_of_squares(ball.u_m, u_position_m);
  for (std::size_t i = 0; i < found->blocks.size(); ++i)
    found->blocks[i].u_rad =
        root_sum_of_squares(found->blocks[i].u_rad, u_position_m / faces[i].half_size_m);
  return found;
}

}  // namespace abbe::calib::evemu
