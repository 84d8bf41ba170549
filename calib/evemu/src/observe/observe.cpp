#include "abbe/calib/evemu/observe/observe.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"
#include "abbe/calib/internal/fit/point_set.hpp"
#include "abbe/result/try.hpp"
#include "observe/errors_shape.hpp"
#include "observe/touched_position.hpp"

namespace abbe::calib::evemu {
namespace {

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
    return failure(ErrorCode::BadInput,
                   message("calibrator \"", c.name,
                           "\" states the thermal expansion of the array, but the temperature of "
                           "the array is not given"));
  }

  if (given && !c.expansivity) {
    return failure(ErrorCode::BadInput,
                   message("the temperature of the array is given, but calibrator \"", c.name,
                           "\" does not state its thermal expansion"));
  }

  return {};
}

Calibrator at_the_machine(const Calibrator& c, const std::optional<Expansion>& expansion) {
  return expansion ? at_temperature(c, *expansion) : c;
}

/// Transform from the calibrator's frame to the uniform frame. Requires a calibrator that has
/// passed check().
RigidTransform pre_to_uniform(const Calibrator& c) {
  return inverse(*uniform_frame(c.balls.front().centre_m, c.blocks[0].normal, c.blocks[1].normal));
}

Result<void> check_volume(const Observations& o, const ObserveOptions& options) {
  std::vector<Vector3> readings;
  for (const BallError& row : o.rows) {
    readings.push_back(row.reading_m);
  }

  const Result<fit::PointSet> set = fit::point_set(readings, 4, "ball array");
  ABBE_TRY(set);

  const double thickness = set->singular_values(2) / set->singular_values(0);
  if (!(thickness >= options.least_thickness)) {
    return failure(
        ErrorCode::DegenerateGeometry,
        message("ball array: the positions are coplanar, all balls lie in one plane (thickness ",
                thickness, " of the extent, needs ", options.least_thickness,
                "): tilt and roll the artefact more"));
  }

  return {};
}

/// Computes the mean reading of Ball1. BadInput if Ball1 moved between positions or its error is
/// not zero.
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
          message("Ball1 was measured ", shift_m * kMmPerM,
                  " mm from its mean position: Ball1 must stay in place while the artefact is "
                  "turned about it"));
    }
    if (row->V_m.norm() * kUmPerM > 1e-3) {
      return at_position(row->position, ErrorCode::BadInput,
                         message("the error of Ball1 is ", row->V_m.norm() * kUmPerM,
                                 " um: errors are relative to Ball1, so it must be 0"));
    }
  }

  return {};
}

Result<Observations> finish(Observations o, const ObserveOptions& options) {
  ABBE_TRY(place_ball1(o, options));
  ABBE_TRY(check_volume(o, options));
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

std::optional<std::size_t> same_orientation_as(const Matrix3& R_self_uni,
                                               std::span<const Matrix3> before,
                                               double least_turn_rad) {
  for (std::size_t i = 0; i < before.size(); ++i) {
    if (Eigen::AngleAxisd(before[i].transpose() * R_self_uni).angle() < least_turn_rad) {
      return i;
    }
  }
  return std::nullopt;
}

Result<TouchedArtefact> see_artefact(int position, std::span<const Touch> touches,
                                     const Calibrator& at_20_C, const ObserveOptions& options) {
  ABBE_TRY(check(at_20_C));
  const Calibrator c = at_the_machine(at_20_C, expansion_of(at_20_C, options));
  Touched touched;
  for (std::size_t i = 0; i < touches.size(); ++i) {
    touched[{touches[i].feature, touches[i].number}].add(touches[i].p_m, i);
  }
  return see(position, touched, c, pre_to_uniform(c), options);
}

Result<Observations> observe(std::span<const Touch> touches, const Calibrator& at_20_C,
                             const Machine& machine, const ObserveOptions& options) {
  ABBE_TRY(check(at_20_C));

  ABBE_TRY(check_temperature(at_20_C, options));

  const std::optional<Expansion> expansion = expansion_of(at_20_C, options);
  const Calibrator c = at_the_machine(at_20_C, expansion);
  const Result<std::map<int, Touched>> positions = by_position(touches, options);

  ABBE_TRY(positions);

  Observations o;
  o.machine = machine;
  o.order = options.order;
  o.artefact = uncertainty_of(c, expansion);
  std::vector<Matrix3> turned;

  for (const auto& [position, touched] : *positions) {
    Result<TouchedArtefact> seen = see(position, touched, c, pre_to_uniform(c), options);
    ABBE_TRY(seen);
    for (std::size_t i = 0; i < c.balls.size(); ++i) {
      const Vector3& reading_m = seen->balls[i].centre;
      // Errors are relative to Ball1: the error of Ball1 is set to exactly zero, without rounding.
      const Vector3 V_m = i == 0 ? Vector3(Vector3::Zero()) : Vector3(seen->ideal_m[i] - reading_m);
      o.rows.push_back({position, c.balls[i].number, reading_m, V_m});
    }
    if (const auto before =
            same_orientation_as(seen->T_self_uni.R, turned, options.least_turn_rad)) {
      return at_position(
          position, ErrorCode::BadInput,
          message("the artefact has the same orientation as at position ", o.seen[*before].position,
                  ": one position was touched twice, or the artefact was not turned"));
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
      return at_position(row.position, ErrorCode::NotFinite,
                         message("ball ", row.ball, " is not a number"));
    }
    if (i > 0 && row.position == o.rows[i - 1].position && row.ball == o.rows[i - 1].ball) {
      return at_position(row.position, ErrorCode::BadInput,
                         message("ball ", row.ball, " is listed twice"));
    }
    has_ball1[row.position] = has_ball1[row.position] || row.ball == 1;
  }

  for (int p = 1; p <= options.positions; ++p) {
    if (!has_ball1.contains(p)) {
      return at_position(p, ErrorCode::TooFewObservations,
                         message("left out; ", options.positions, " positions are required"));
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

  ABBE_TRY(check_one_shape(o));

  return finish(std::move(o), options);
}

}  // namespace abbe::calib::evemu
