#include "observe/touched_position.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>

#include "abbe/calib/geometry/usual_mistakes.hpp"
#include "abbe/calib/internal/base/units.hpp"
#include "abbe/result/try.hpp"
#include "observe/touch_checks.hpp"
#include "run/angle.hpp"

namespace abbe::calib::evemu {
namespace {

const char* name_of(Feature feature) {
  return feature == Feature::Ball ? "ball" : "block";
}

Result<void> check_complete(int position, const Touched& touched, const Calibrator& c,
                            const ObserveOptions& options) {
  for (const auto& [feature, points] : touched) {
    const int most = feature.first == Feature::Ball ? static_cast<int>(c.balls.size()) : 2;
    if (feature.second < 1 || feature.second > most) {
      return at_position(
          position, ErrorCode::BadInput,
          message("the calibrator has no ", name_of(feature.first), " ", feature.second));
    }
  }

  const auto require = [&](Feature feature, int number, std::size_t least) -> Result<void> {
    const auto at = touched.find({feature, number});
    const std::size_t points = at == touched.end() ? 0 : at->second.points_m.size();
    if (points == 0) {
      return at_position(position, ErrorCode::TooFewObservations,
                         message(name_of(feature), " ", number, " was left out"));
    }
    if (points < least) {
      return at_position(position, ErrorCode::TooFewObservations,
                         message(name_of(feature), " ", number, " has too few points: ", points,
                                 ", needs ", least));
    }
    return {};
  };

  for (const Calibrator::Ball& ball : c.balls) {
    if (Result<void> enough = require(Feature::Ball, ball.number, options.least_points_per_ball);
        !enough) {
      return enough;
    }
  }

  for (const Calibrator::Block& block : c.blocks) {
    if (Result<void> enough = require(Feature::Block, block.number, options.least_points_per_block);
        !enough) {
      return enough;
    }
  }

  return {};
}

Result<std::vector<fit::Sphere>> fit_balls(int position, const Touched& touched,
                                           const Calibrator& c) {
  std::vector<fit::Sphere> spheres;
  for (const Calibrator::Ball& ball : c.balls) {
    Result<fit::Sphere> sphere = fit::fit_sphere(touched.at({Feature::Ball, ball.number}).points_m);
    if (!sphere) {
      return at_position(position, sphere.error().code,
                         message("ball ", ball.number, ": ", sphere.error().text));
    }
    spheres.push_back(*sphere);
  }
  return spheres;
}

Result<void> check_single_touches(int position, const Touched& touched,
                                  const ObserveOptions& options) {
  for (const auto& [feature, points] : touched) {
    const auto wrong = feature.first == Feature::Ball
                           ? wrong_touch_on_ball(points.points_m, options)
                           : wrong_touch_on_face(points.points_m, options);
    if (wrong) {
      return at_position(position, ErrorCode::BadInput,
                         message(name_of(feature.first), " ", feature.second, ": ", *wrong));
    }
  }
  return {};
}

Result<void> check_twice(int position, std::span<const fit::Sphere> balls) {
  for (std::size_t i = 0; i < balls.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const double apart_m = (balls[i].centre - balls[j].centre).norm();
      if (apart_m < 0.5 * (balls[i].radius + balls[j].radius)) {
        return at_position(position, ErrorCode::BadInput,
                           message("one ball was touched twice, as ball ", j + 1, " and as ball ",
                                   i + 1, " (centres ", apart_m * kMmPerM, " mm apart)"));
      }
    }
  }
  return {};
}

/// Text "; they fit with ..." that names the mistaken unit of the touches: converted from this
/// unit, the radii of the balls agree with those of the calibrator. Empty if they agree with none.
std::string radii_fit_with(std::span<const fit::Sphere> balls, const Calibrator& c) {
  constexpr double kSame = 0.05;  // relative difference of radii: touches determine a radius to a
                                  // few per cent
  for (const UnitMistake& mistake : unit_mistakes()) {
    bool all = true;
    for (std::size_t i = 0; i < balls.size(); ++i) {
      const double expected_m = c.balls[i].radius_m + c.tip_radius_m;
      all = all && std::abs(mistake.factor * balls[i].radius / expected_m - 1.0) < kSame;
    }
    if (all) {
      return "; they fit with " + mistake.text;
    }
  }
  return "";
}

/// With at most this many touches the false one is not named: a sphere has four unknowns, and two
/// or fewer redundant touches do not show which of them is false.
constexpr std::size_t kTooFewToName = 6;

/// Index of the touch without which the other touches fit a sphere much better, with a radius whose
/// difference to `radius_m` is at most half of that with all touches. nullopt if there is none.
std::optional<std::size_t> touch_off_radius(std::span<const Vector3> points_m, double radius_m) {
  constexpr double kClear = 3.0;  // ratio of rms; machine errors of some mm deform the sphere
  const Result<fit::Sphere> all = fit::fit_sphere(points_m);

  if (!all || points_m.size() <= kTooFewToName) {
    return std::nullopt;
  }

  const double most_off_m = 0.5 * std::abs(all->radius - radius_m);
  double least_m = all->residuals.rms / kClear;
  std::optional<std::size_t> found;

  for (std::size_t k = 0; k < points_m.size(); ++k) {
    std::vector<Vector3> others(points_m.begin(), points_m.end());
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(k));
    const Result<fit::Sphere> s = fit::fit_sphere(others);
    if (s && std::abs(s->radius - radius_m) <= most_off_m && s->residuals.rms < least_m) {
      least_m = s->residuals.rms;
      found = k;
    }
  }

  return found;
}

bool has_its_radius(const fit::Sphere& ball, double expected_m, const ObserveOptions& options) {
  return std::abs(ball.radius - expected_m) <= options.max_radius_mismatch_m;
}

std::size_t balls_of_another_radius(std::span<const fit::Sphere> balls, const Calibrator& c,
                                    const ObserveOptions& options) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < balls.size(); ++i) {
    const double expected_m = c.balls[i].radius_m + c.tip_radius_m;
    count += has_its_radius(balls[i], expected_m, options) ? 0 : 1;
  }
  return count;
}

std::string why_another_radius(std::span<const fit::Sphere> balls,
                               std::span<const Vector3> points_m, double expected_m,
                               const Calibrator& c, const ObserveOptions& options) {
  if (const auto k = touch_off_radius(points_m, expected_m)) {
    return message("without touch ", *k + 1, " of ", points_m.size(),
                   " it comes nearer to that radius: a false trigger, or dirt; touch there again");
  }

  if (balls.size() > 1 && balls_of_another_radius(balls, c, options) == 1) {
    const std::string one_ball = "the other balls fit: ";
    return points_m.size() > kTooFewToName
               ? one_ball + "check the radius of this ball in the calibrator file, and clean it"
               : one_ball + message("one of its ", points_m.size(),
                                    " touches is a false trigger, or on dirt, too few to find "
                                    "which one; clean this ball and touch it again");
  }

  return "calibrator file of another artefact, or another tip" + radii_fit_with(balls, c);
}

Result<void> check_radii(int position, const Touched& touched, std::span<const fit::Sphere> balls,
                         const Calibrator& c, const ObserveOptions& options) {
  for (std::size_t i = 0; i < balls.size(); ++i) {
    const double expected_m = c.balls[i].radius_m + c.tip_radius_m;
    if (!has_its_radius(balls[i], expected_m, options)) {
      const auto& points_m = touched.at({Feature::Ball, c.balls[i].number}).points_m;
      return at_position(
          position, ErrorCode::BadInput,
          message("ball ", i + 1, " has radius ", balls[i].radius * kMmPerM, " mm, calibrator \"",
                  c.name, "\" and tip give ", expected_m * kMmPerM,
                  " mm: ", why_another_radius(balls, points_m, expected_m, c, options)));
    }
  }
  return {};
}

/// BadInput if the touches have a wrong unit of length. The unit is checked before single touches,
/// because with a wrong unit every touch seems false.
Result<void> check_unit(int position, const Touched& touched, std::span<const fit::Sphere> balls,
                        const Calibrator& c, const ObserveOptions& options) {
  return radii_fit_with(balls, c).empty() ? Result<void>{}
                                          : check_radii(position, touched, balls, c, options);
}

/// Text "; they fit with ..." that names the mistakes with which the ball centres agree with the
/// calibrator: a reflection, other ball numbers. Empty if no tested mistake does.
std::string balls_fit_with(std::span<const Vector3> calibrated, std::span<const Vector3> seen,
                           const ObserveOptions& options) {
  const auto fits = [&](const std::vector<Vector3>& from) {
    const Result<RigidTransform> T = fit_rigid(from, seen);
    for (std::size_t i = 0; T && i < from.size(); ++i) {
      if ((*T * from[i] - seen[i]).norm() > options.max_shape_mismatch_m) {
        return false;
      }
    }
    return T.has_value();
  };

  std::vector<std::string> texts;
  std::vector<Vector3> mirrored;
  for (const Vector3& p : calibrated) {
    mirrored.emplace_back(-p.x(), p.y(), p.z());
  }

  if (fits(mirrored)) {
    texts.emplace_back("one axis reversed or two axes swapped (a mirror image)");
  }

  if (fits({calibrated.rbegin(), calibrated.rend()})) {
    texts.emplace_back("the balls numbered backwards");
  }

  for (std::size_t i = 0; i < calibrated.size(); ++i) {
    for (std::size_t j = i + 1; j < calibrated.size(); ++j) {
      std::vector<Vector3> swapped(calibrated.begin(), calibrated.end());
      std::swap(swapped[i], swapped[j]);
      if (fits(swapped)) {
        texts.push_back(message("balls ", i + 1, " and ", j + 1, " swapped"));
      }
    }
  }

  return texts.empty() ? "" : "; they fit with " + or_list(texts);
}

/// Transformation from calibration to machine coordinates, from the balls alone.
Result<RigidTransform> rough_pose(int position, std::span<const fit::Sphere> balls,
                                  const Calibrator& c, const ObserveOptions& options) {
  std::vector<Vector3> from, to;
  for (std::size_t i = 0; i < balls.size(); ++i) {
    from.push_back(c.balls[i].centre_m);
    to.push_back(balls[i].centre);
  }

  const Result<RigidTransform> T = fit_rigid(from, to);
  if (!T) {
    return at_position(position, T.error().code, T.error().text);
  }

  double worst_m = 0.0;
  std::size_t worst = 0;
  for (std::size_t i = 0; i < balls.size(); ++i) {
    const double off_m = (*T * from[i] - to[i]).norm();
    if (off_m > worst_m) {
      worst_m = off_m;
      worst = i;
    }
  }

  if (worst_m > options.max_shape_mismatch_m) {
    return at_position(
        position, ErrorCode::BadInput,
        message("the balls do not have the shape of calibrator \"", c.name, "\": ball ", worst + 1,
                " is ", worst_m * kMmPerM,
                " mm off: calibrator file of another artefact, or balls numbered differently",
                balls_fit_with(from, to, options)));
  }

  return *T;
}

Result<void> fit_blocks(TouchedArtefact& seen, const Touched& touched, const Calibrator& c,
                        const RigidTransform& T_machine_pre, const ObserveOptions& options) {
  std::array<Vector3, 2> nominal;
  for (std::size_t b = 0; b < 2; ++b) {
    nominal[b] = T_machine_pre.R * c.blocks[b].normal.normalized();
    const TouchedPoints& face = touched.at({Feature::Block, static_cast<int>(b) + 1});
    seen.block_points_m[b] = face.points_m;
    seen.block_index[b] = face.mean_index();
    Result<fit::Plane> plane = fit::fit_plane(seen.block_points_m[b], nominal[b]);
    if (!plane) {
      return at_position(seen.position, plane.error().code,
                         message("block ", b + 1, ": ", plane.error().text));
    }
    seen.blocks[b] = *plane;
  }

  const auto fits = [&](std::size_t plane, std::size_t block) {
    return line_angle_rad(seen.blocks[plane].normal, nominal[block]) <= options.max_block_tilt_rad;
  };

  if (!(fits(0, 0) && fits(1, 1))) {
    if (fits(0, 1) && fits(1, 0)) {
      return at_position(seen.position, ErrorCode::BadInput, "blocks 1 and 2 are swapped");
    }
    const std::size_t wrong = fits(0, 0) ? 1 : 0;
    return at_position(
        seen.position, ErrorCode::BadInput,
        message("block ", wrong + 1, " is tilted by ",
                line_angle_rad(seen.blocks[wrong].normal, nominal[wrong]) * kMmPerM,
                " mrad against calibrator \"", c.name, "\": another face, or another artefact"));
  }

  return {};
}

}  // namespace

Result<std::map<int, Touched>> by_position(std::span<const Touch> touches,
                                           const ObserveOptions& options) {
  std::map<int, Touched> found;
  for (std::size_t i = 0; i < touches.size(); ++i) {
    if (!touches[i].p_m.allFinite()) {
      return at_position(touches[i].position, ErrorCode::NotFinite,
                         message("touch ", i, " is not a number"));
    }
    found[touches[i].position][{touches[i].feature, touches[i].number}].add(touches[i].p_m, i);
  }

  for (int p = 1; p <= options.positions; ++p) {
    if (!found.contains(p)) {
      return at_position(
          p, ErrorCode::TooFewObservations,
          message("left out: no touches; ", options.positions, " positions are required"));
    }
  }

  for (const auto& [position, touched] : found) {
    if (position < 1 || position > options.positions) {
      return at_position(position, ErrorCode::BadInput,
                         message("positions are numbered 1 to ", options.positions));
    }
  }

  return found;
}

Result<TouchedArtefact> see(int position, const Touched& touched, const Calibrator& c,
                            const RigidTransform& T_uni_pre, const ObserveOptions& options) {
  ABBE_TRY(check_complete(position, touched, c, options));

  TouchedArtefact seen;
  seen.position = position;
  Result<std::vector<fit::Sphere>> balls = fit_balls(position, touched, c);

  ABBE_TRY(balls);

  ABBE_TRY(check_unit(position, touched, *balls, c, options));

  ABBE_TRY(check_single_touches(position, touched, options));

  seen.balls = *std::move(balls);
  for (const Calibrator::Ball& ball : c.balls) {
    const TouchedPoints& points = touched.at({Feature::Ball, ball.number});
    seen.ball_points_m.push_back(points.points_m);
    seen.ball_index.push_back(points.mean_index());
  }

  ABBE_TRY(check_twice(position, seen.balls));

  ABBE_TRY(check_radii(position, touched, seen.balls, c, options));

  const Result<RigidTransform> pose = rough_pose(position, seen.balls, c, options);
  ABBE_TRY(pose);

  ABBE_TRY(fit_blocks(seen, touched, c, *pose, options));

  Result<RigidTransform> frame =
      uniform_frame(seen.balls.front().centre, seen.blocks[0].normal, seen.blocks[1].normal);
  if (!frame) {
    return at_position(position, frame.error().code, frame.error().text);
  }

  seen.T_self_uni = *frame;
  if (touched_from_below(seen)) {
    return at_position(
        position, ErrorCode::BadInput,
        message("the balls were touched from below, against the normal of block 1 of calibrator \"",
                c.name,
                "\": an axis is mirrored, or two axes are swapped, or the normal points inward"));
  }

  for (const Calibrator::Ball& ball : c.balls) {
    seen.ideal_m.push_back(seen.T_self_uni * (T_uni_pre * ball.centre_m));
  }

  return seen;
}

}  // namespace abbe::calib::evemu
