#include "abbe/calib/evemu/observe.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>

#include "abbe/calib/axis_mistakes.hpp"
#include "abbe/calib/fit/point_set.hpp"
#include "evemu/angle.hpp"
#include "evemu/touch_checks.hpp"
#include "message.hpp"
#include "units.hpp"

namespace abbe::calib::evemu {
namespace {

/// Touched points of one ball or block.
struct TouchedPoints {
  std::vector<Vector3> points_m;
  double index_sum = 0.0;  ///< of their places among all touches

  void add(const Vector3& p_m, std::size_t index) {
    points_m.push_back(p_m);
    index_sum += static_cast<double>(index);
  }
  [[nodiscard]] double mean_index() const { return index_sum / static_cast<double>(points_m.size()); }
};
/// Of one position, by feature and number.
using Touched = std::map<std::pair<Feature, int>, TouchedPoints>;

const char* name_of(Feature feature) {
  return feature == Feature::Ball ? "ball" : "block";
}

tl::unexpected<Error> at_position(int position, ErrorCode code, const std::string& what) {
  return failure(code, message("position ", position, ": ", what));
}

Result<std::map<int, Touched>> by_position(std::span<const Touch> touches, const ObserveOptions& options) {
  std::map<int, Touched> found;
  for (std::size_t i = 0; i < touches.size(); ++i) {
    if (!touches[i].p_m.allFinite()) {
      return at_position(touches[i].position, ErrorCode::NotFinite, message("touch ", i, " is not a number"));
    }
    found[touches[i].position][{touches[i].feature, touches[i].number}].add(touches[i].p_m, i);
  }
  for (int p = 1; p <= options.positions; ++p) {
    if (!found.contains(p)) {
      return at_position(
          p, ErrorCode::TooFewObservations,
          message("left out: nothing was touched there, of ", options.positions, " positions"));
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

Result<void> check_complete(int position, const Touched& touched, const Calibrator& c,
                            const ObserveOptions& options) {
  for (const auto& [feature, points] : touched) {
    const int most = feature.first == Feature::Ball ? static_cast<int>(c.balls.size()) : 2;
    if (feature.second < 1 || feature.second > most) {
      return at_position(position, ErrorCode::BadInput,
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
      return at_position(
          position, ErrorCode::TooFewObservations,
          message(name_of(feature), " ", number, " has too few points: ", points, ", needs ", least));
    }
    return {};
  };
  for (const Calibrator::Ball& ball : c.balls) {
    if (Result<void> enough = require(Feature::Ball, ball.number, options.least_points_per_ball); !enough) {
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

Result<std::vector<fit::Sphere>> fit_balls(int position, const Touched& touched, const Calibrator& c) {
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

Result<void> check_single_touches(int position, const Touched& touched, const ObserveOptions& options) {
  for (const auto& [feature, points] : touched) {
    const auto wrong = feature.first == Feature::Ball ? wrong_touch_on_ball(points.points_m, options)
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
                           message("one ball was touched twice, as ball ", j + 1, " and as ball ", i + 1,
                                   " (centres ", apart_m * kMmPerM, " mm apart)"));
      }
    }
  }
  return {};
}

/// "; they fit with lengths in m where mm belong"
std::string radii_fit_with(std::span<const fit::Sphere> balls, const Calibrator& c) {
  constexpr double kSame = 0.05;  // relative: radii that the touches know to a few per cent
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

Result<void> check_radii(int position, std::span<const fit::Sphere> balls, const Calibrator& c,
                         const ObserveOptions& options) {
  for (std::size_t i = 0; i < balls.size(); ++i) {
    const double expected_m = c.balls[i].radius_m + c.tip_radius_m;
    if (!(std::abs(balls[i].radius - expected_m) <= options.max_radius_mismatch_m)) {
      return at_position(
          position, ErrorCode::BadInput,
          message("ball ", i + 1, " has radius ", balls[i].radius * kMmPerM, " mm, calibrator \"", c.name,
                  "\" and tip make ", expected_m * kMmPerM,
                  " mm: calibrator file of another artefact, or another tip", radii_fit_with(balls, c)));
    }
  }
  return {};
}

/// In another unit of length every touch seems false.
Result<void> check_unit(int position, std::span<const fit::Sphere> balls, const Calibrator& c,
                        const ObserveOptions& options) {
  return radii_fit_with(balls, c).empty() ? Result<void>{} : check_radii(position, balls, c, options);
}

/// "; they fit with ...": a reflection, other numbers. Empty: with nothing that was tried.
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
  return texts.empty() ? "" : "; they fit with " + joined_with_or(texts);
}

/// Machine from calibration coordinates, by the balls alone.
Result<RigidTransform> rough_pose(int position, std::span<const fit::Sphere> balls, const Calibrator& c,
                                  const ObserveOptions& options) {
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
    return at_position(position, ErrorCode::BadInput,
                       message("the balls do not have the shape of calibrator \"", c.name, "\": ball ",
                               worst + 1, " is ", worst_m * kMmPerM,
                               " mm off: calibrator file of another artefact, or balls numbered differently",
                               balls_fit_with(from, to, options)));
  }
  return *T;
}

Result<void> fit_blocks(SeenArtefact& seen, const Touched& touched, const Calibrator& c,
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

Result<SeenArtefact> see(int position, const Touched& touched, const Calibrator& c,
                         const RigidTransform& T_uni_pre, const ObserveOptions& options) {
  if (Result<void> complete = check_complete(position, touched, c, options); !complete) {
    return tl::unexpected(complete.error());
  }
  SeenArtefact seen;
  seen.position = position;
  Result<std::vector<fit::Sphere>> balls = fit_balls(position, touched, c);
  if (!balls) {
    return tl::unexpected(balls.error());
  }
  if (Result<void> unit = check_unit(position, *balls, c, options); !unit) {
    return tl::unexpected(unit.error());
  }
  if (Result<void> single = check_single_touches(position, touched, options); !single) {
    return tl::unexpected(single.error());
  }
  seen.balls = *std::move(balls);
  for (const Calibrator::Ball& ball : c.balls) {
    const TouchedPoints& points = touched.at({Feature::Ball, ball.number});
    seen.ball_points_m.push_back(points.points_m);
    seen.ball_index.push_back(points.mean_index());
  }
  if (Result<void> twice = check_twice(position, seen.balls); !twice) {
    return tl::unexpected(twice.error());
  }
  if (Result<void> radii = check_radii(position, seen.balls, c, options); !radii) {
    return tl::unexpected(radii.error());
  }
  const Result<RigidTransform> pose = rough_pose(position, seen.balls, c, options);
  if (!pose) {
    return tl::unexpected(pose.error());
  }
  if (Result<void> blocks = fit_blocks(seen, touched, c, *pose, options); !blocks) {
    return tl::unexpected(blocks.error());
  }
  Result<RigidTransform> frame =
      uniform_frame(seen.balls.front().centre, seen.blocks[0].normal, seen.blocks[1].normal);
  if (!frame) {
    return at_position(position, frame.error().code, frame.error().text);
  }
  seen.T_self_uni = *frame;
  if (touched_from_below(seen)) {
    return at_position(
        position, ErrorCode::BadInput,
        message("the balls were touched from below, against the normal of block 1 of calibrator \"", c.name,
                "\": an axis is mirrored, or two axes are swapped, or the normal points inward"));
  }
  for (const Calibrator::Ball& ball : c.balls) {
    seen.ideal_m.push_back(seen.T_self_uni * (T_uni_pre * ball.centre_m));
  }
  return seen;
}

RigidTransform inverse(const RigidTransform& T) {
  return {T.R.transpose(), -(T.R.transpose() * T.t_m)};
}

std::optional<Expansion> expansion_of(const Calibrator& c, const ObserveOptions& options) {
  if (!c.expansivity || !options.artefact_temperature) {
    return std::nullopt;
  }
  return Expansion{c.expansivity->alpha_per_K, c.expansivity->u_alpha_per_K,
                   options.artefact_temperature->temperature_K,
                   options.artefact_temperature->u_temperature_K};
}

Result<void> check_temperature(const Calibrator& c, const ObserveOptions& options) {
  const auto& given = options.artefact_temperature;
  if (given && !(given->temperature_K > 0.0 && std::isfinite(given->temperature_K) &&
                 given->u_temperature_K >= 0.0 && std::isfinite(given->u_temperature_K))) {
    return failure(ErrorCode::BadInput, message("temperature of the array: ", given->temperature_K,
                                                " K, u = ", given->u_temperature_K, " K"));
  }
  if (c.expansivity && !given) {
    return failure(
        ErrorCode::BadInput,
        message("calibrator \"", c.name, "\" says how the array grows, but nothing says how warm it was"));
  }
  if (given && !c.expansivity) {
    return failure(ErrorCode::BadInput, message("the temperature of the array is given, but calibrator \"",
                                                c.name, "\" does not say how it grows"));
  }
  return {};
}

Calibrator at_the_machine(const Calibrator& c, const std::optional<Expansion>& expansion) {
  return expansion ? grown(c, *expansion) : c;
}

/// Of a calibrator that has passed check().
RigidTransform pre_to_uniform(const Calibrator& c) {
  return inverse(*uniform_frame(c.balls.front().centre_m, c.blocks[0].normal, c.blocks[1].normal));
}

Result<void> check_volume(const Observations& o, const ObserveOptions& options) {
  std::vector<Vector3> readings;
  for (const BallError& row : o.rows) {
    readings.push_back(row.reading_m);
  }
  const Result<fit::PointSet> set = fit::point_set(readings, 4, "ball array");
  if (!set) {
    return tl::unexpected(set.error());
  }
  const double thickness = set->singular_values(2) / set->singular_values(0);
  if (!(thickness >= options.least_thickness)) {
    return failure(
        ErrorCode::DegenerateGeometry,
        message("ball array: the positions are coplanar, all balls lie in one plane (thickness ", thickness,
                " of the extent, needs ", options.least_thickness, "): tilt and roll the artefact more"));
  }
  return {};
}

/// Ball1 of every position, which must be there, be zero, and stand still.
Result<void> place_ball1(Observations& o, const ObserveOptions& options) {
  std::vector<const BallError*> first;
  for (const BallError& row : o.rows) {
    if (row.ball == 1) {
      first.push_back(&row);
      o.ball1_m += row.reading_m;
    }
  }
  o.ball1_m /= static_cast<double>(std::max<std::size_t>(1, first.size()));
  for (const BallError* row : first) {
    const double shift_m = (row->reading_m - o.ball1_m).norm();
    if (shift_m > options.max_ball1_shift_m) {
      return at_position(
          row->position, ErrorCode::BadInput,
          message("Ball1 was read ", shift_m * kMmPerM,
                  " mm from its mean place: it must stand still, the artefact turns about it"));
    }
    if (row->V_m.norm() * kUmPerM > 1e-3) {
      return at_position(row->position, ErrorCode::BadInput,
                         message("the error of Ball1 is ", row->V_m.norm() * kUmPerM,
                                 " um: errors are relative to Ball1, it must be 0"));
    }
  }
  return {};
}

/// Scatter, over the positions, of the distances between balls at reading + L V: 0 for the true places of one
/// artefact, whatever V has of a rotation.
double shape_scatter_m(const Observations& o, const Matrix3& L) {
  std::map<std::pair<int, int>, std::vector<double>> distances_m;
  for (std::size_t i = 0; i < o.rows.size(); ++i) {
    for (std::size_t j = i + 1; j < o.rows.size() && o.rows[j].position == o.rows[i].position; ++j) {
      const Vector3 a = o.rows[i].reading_m + L * o.rows[i].V_m, b = o.rows[j].reading_m + L * o.rows[j].V_m;
      distances_m[{o.rows[i].ball, o.rows[j].ball}].push_back((b - a).norm());
    }
  }
  double squares = 0.0, free = 0.0;
  for (const auto& [balls, d] : distances_m) {
    const double mean = std::accumulate(d.begin(), d.end(), 0.0) / static_cast<double>(d.size());
    for (const double x : d) {
      squares += (x - mean) * (x - mean);
    }
    free += static_cast<double>(d.size()) - 1.0;
  }
  return free > 0.0 ? std::sqrt(squares / free) : 0.0;
}

/// What V may have suffered on its way into the file.
std::vector<AxisMistake> mistakes_of_errors() {
  std::vector<AxisMistake> all{
      {"all signs reversed (V = actual - nominal, in um)", -Matrix3::Identity()},
      {"errors in mm where um belong", 1e3 * Matrix3::Identity()},
      {"errors in mm where um belong and all signs reversed", -1e3 * Matrix3::Identity()}};
  for (const AxisMistake& mistake : axis_mistakes()) {
    all.push_back({mistake.text + " in errors or readings", mistake.M});
  }
  return all;
}

/// Noise of reading and V together leaves a scatter, too: only a change that leaves a third of it names a
/// mistake.
Result<void> check_one_shape(const Observations& o) {
  constexpr double kClearly = 1.0 / 3.0, kLeast_m = 1e-6;
  const double given_m = shape_scatter_m(o, Matrix3::Identity());
  double best_m = std::max(kClearly * given_m, kLeast_m / 10.0);
  std::string text;
  for (const AxisMistake& mistake : mistakes_of_errors()) {
    if (const double scatter_m = shape_scatter_m(o, mistake.M); scatter_m < best_m) {
      best_m = scatter_m;
      text = mistake.text;
    }
  }
  if (given_m < kLeast_m || text.empty()) {
    return {};
  }
  return failure(
      ErrorCode::BadInput,
      message("errors: distances between the balls differ by ", kUmPerM * given_m,
              " um rms from position to position; they fit (", kUmPerM * best_m, " um) with ", text));
}

Result<Observations> finish(Observations o, const ObserveOptions& options) {
  if (Result<void> placed = place_ball1(o, options); !placed) {
    return tl::unexpected(placed.error());
  }
  if (Result<void> volume = check_volume(o, options); !volume) {
    return tl::unexpected(volume.error());
  }
  return o;
}

}  // namespace

std::size_t Observations::positions() const {
  std::size_t count = 0;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    count += i == 0 || rows[i].position != rows[i - 1].position ? 1 : 0;
  }
  return count;
}

std::optional<std::size_t> stands_as_at(const Matrix3& R_self_uni, std::span<const Matrix3> before,
                                        double least_turn_rad) {
  for (std::size_t i = 0; i < before.size(); ++i) {
    if (Eigen::AngleAxisd(before[i].transpose() * R_self_uni).angle() < least_turn_rad) {
      return i;
    }
  }
  return std::nullopt;
}

Result<SeenArtefact> see_artefact(int position, std::span<const Touch> touches, const Calibrator& at_20_C,
                                  const ObserveOptions& options) {
  if (Result<void> sound = check(at_20_C); !sound) {
    return tl::unexpected(sound.error());
  }
  const Calibrator c = at_the_machine(at_20_C, expansion_of(at_20_C, options));
  Touched touched;
  for (std::size_t i = 0; i < touches.size(); ++i) {
    touched[{touches[i].feature, touches[i].number}].add(touches[i].p_m, i);
  }
  return see(position, touched, c, pre_to_uniform(c), options);
}

Result<Observations> observe(std::span<const Touch> touches, const Calibrator& at_20_C,
                             const Machine& machine, const ObserveOptions& options) {
  if (Result<void> sound = check(at_20_C); !sound) {
    return tl::unexpected(sound.error());
  }
  if (Result<void> known = check_temperature(at_20_C, options); !known) {
    return tl::unexpected(known.error());
  }
  const std::optional<Expansion> expansion = expansion_of(at_20_C, options);
  const Calibrator c = at_the_machine(at_20_C, expansion);
  const Result<std::map<int, Touched>> positions = by_position(touches, options);
  if (!positions) {
    return tl::unexpected(positions.error());
  }
  Observations o;
  o.machine = machine;
  o.order = options.order;
  o.artefact = uncertainty_of(c, expansion);
  std::vector<Matrix3> turned;
  for (const auto& [position, touched] : *positions) {
    Result<SeenArtefact> seen = see(position, touched, c, pre_to_uniform(c), options);
    if (!seen) {
      return tl::unexpected(seen.error());
    }
    for (std::size_t i = 0; i < c.balls.size(); ++i) {
      const Vector3& reading_m = seen->balls[i].centre;
      // Ball1 is the origin of both frames: exactly zero, not rounding.
      const Vector3 V_m = i == 0 ? Vector3(Vector3::Zero()) : Vector3(seen->ideal_m[i] - reading_m);
      o.rows.push_back({position, c.balls[i].number, reading_m, V_m});
    }
    if (const auto before = stands_as_at(seen->T_self_uni.R, turned, options.least_turn_rad)) {
      return at_position(position, ErrorCode::BadInput,
                         message("the artefact stands as at position ", o.seen[*before].position,
                                 ": touches of one position twice, or it was not turned"));
    }
    turned.push_back(seen->T_self_uni.R);
    o.seen.push_back(*std::move(seen));
  }
  return finish(std::move(o), options);
}

Result<Observations> observe_errors(std::span<const BallError> errors, const Machine& machine,
                                    RotationOrigin rotation, const ObserveOptions& options) {
  Observations o;
  o.machine = machine;
  o.order = options.order;
  o.rotation = rotation;
  o.rows.assign(errors.begin(), errors.end());
  std::sort(o.rows.begin(), o.rows.end(), [](const BallError& a, const BallError& b) {
    return std::pair(a.position, a.ball) < std::pair(b.position, b.ball);
  });
  std::map<int, bool> has_ball1;
  for (std::size_t i = 0; i < o.rows.size(); ++i) {
    const BallError& row = o.rows[i];
    if (!row.reading_m.allFinite() || !row.V_m.allFinite()) {
      return at_position(row.position, ErrorCode::NotFinite, message("ball ", row.ball, " is not a number"));
    }
    if (i > 0 && row.position == o.rows[i - 1].position && row.ball == o.rows[i - 1].ball) {
      return at_position(row.position, ErrorCode::BadInput,
                         message("ball ", row.ball, " stands there twice"));
    }
    has_ball1[row.position] = has_ball1[row.position] || row.ball == 1;
  }
  for (int p = 1; p <= options.positions; ++p) {
    if (!has_ball1.contains(p)) {
      return at_position(p, ErrorCode::TooFewObservations,
                         message("left out, of ", options.positions, " positions"));
    }
  }
  for (const auto& [position, has] : has_ball1) {
    if (!has) {
      return at_position(position, ErrorCode::TooFewObservations, "Ball1 was left out");
    }
    if (position < 1 || position > options.positions) {
      return at_position(position, ErrorCode::BadInput,
                         message("positions are numbered 1 to ", options.positions));
    }
  }
  if (Result<void> one = check_one_shape(o); !one) {
    return tl::unexpected(one.error());
  }
  return finish(std::move(o), options);
}

}  // namespace abbe::calib::evemu
