#include "abbe/calib/mfb/run/measurement.hpp"

#include <cmath>
#include <set>

#include "abbe/calib/internal/base/message.hpp"

namespace abbe::calib::mfb {
namespace {

tl::unexpected<Error> bad_measurement(const Measurement& m, const std::string& what) {
  return failure(ErrorCode::BadInput, message(m.name, ": ", what));
}

bool is_finite(const Measurement& m) {
  return m.origin_m.allFinite() && m.bar_x.allFinite() && m.bar_z.allFinite() &&
         m.tool_offset_m.allFinite() && (!m.temperature_K || std::isfinite(*m.temperature_K));
}

Result<void> check_one(const Measurement& m, const Bar& bar) {
  constexpr double kPerpendicular_rad = 1e-3, kMostToolOffset_m = 10.0;
  if (m.name.empty()) {
    return failure(ErrorCode::BadInput, "plan: a measurement has no name");
  }
  if (!is_finite(m)) {
    return failure(ErrorCode::NotFinite, message(m.name, ": a number is not a number"));
  }
  if (!(m.bar_x.norm() > 0.0) || !(m.bar_z.norm() > 0.0)) {
    return bad_measurement(m, "a bar axis has no length");
  }
  if (std::abs(m.bar_x.normalized().dot(m.bar_z.normalized())) > kPerpendicular_rad) {
    return bad_measurement(m, "bar_x and bar_z are more than 1 mrad from perpendicular");
  }
  if (m.tool_offset_m.norm() > kMostToolOffset_m) {
    return bad_measurement(
        m, message("the tool offset ", mm_text(m.tool_offset_m), " is longer than 10 m"));
  }
  if (bar.expansion && !m.temperature_K) {
    return bad_measurement(m, "the temperature of the bar is missing; the bar has an expansion");
  }
  return {};
}

Result<void> check_noise(const Plan& plan, const Bar& bar) {
  const TouchNoise& n = plan.noise;
  if (!std::isfinite(n.probe_m) || !std::isfinite(n.machine_m) ||
      !(n.probe_m >= 0.0 && n.machine_m >= 0.0 && n.probe_m + n.machine_m > 0.0)) {
    return failure(
        ErrorCode::BadInput,
        "plan: the noise of probe and machine must not be negative, one of them positive");
  }
  if (!std::isfinite(n.u_temperature_K) || n.u_temperature_K < 0.0 ||
      !std::isfinite(n.common_temperature_K()) || n.common_temperature_K() < 0.0) {
    return failure(ErrorCode::BadInput,
                   "plan: the uncertainty of the temperature must not be negative");
  }
  if (!(plan.tip_radius_m >= 0.0 && plan.tip_radius_m < bar.pattern.hole_radius_m)) {
    return failure(ErrorCode::BadInput, message("plan: a tip of radius ", 1e3 * plan.tip_radius_m,
                                                " mm does not fit into holes of radius ",
                                                1e3 * bar.pattern.hole_radius_m, " mm"));
  }
  if (!plan.gravity.allFinite() || !(plan.gravity.norm() > 0.0)) {
    return failure(ErrorCode::BadInput, "plan: gravity has no direction");
  }
  return {};
}

Result<void> check_one_pose(const Measurement& m, const Measurement& first) {
  constexpr double kSame = 1e-9;
  const bool same =
      (m.origin_m - first.origin_m).norm() < kSame && (m.axes() - first.axes()).norm() < kSame;
  return same ? Result<void>{}
              : bad_measurement(m, message("position ", m.position,
                                           " has another pose than in measurement ", first.name));
}

}  // namespace

Matrix3 Measurement::axes() const {
  const Vector3 x = bar_x.normalized();
  const Vector3 y = bar_z.cross(x).normalized();
  Matrix3 R;
  R << x, y, x.cross(y);
  return R;
}

Result<void> check(const Plan& plan, const Bar& bar) {
  if (plan.measurements.empty()) {
    return failure(ErrorCode::BadInput, "plan: no measurement");
  }
  if (Result<void> valid = check_noise(plan, bar); !valid) {
    return valid;
  }

  std::set<std::string> names;
  for (const Measurement& m : plan.measurements) {
    if (Result<void> valid = check_one(m, bar); !valid) {
      return valid;
    }
    if (!names.insert(m.name).second) {
      return bad_measurement(m, "the name occurs twice");
    }
    for (const Measurement& first : plan.measurements) {
      if (first.position == m.position) {
        if (Result<void> valid = check_one_pose(m, first); !valid) {
          return valid;
        }
        break;
      }
    }
  }
  return {};
}

std::vector<std::optional<std::size_t>> pairs_of(std::span<const Measurement> all) {
  std::vector<std::optional<std::size_t>> forward_of(all.size());
  std::vector<bool> has_pair(all.size(), false);
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (all[i].direction != PassDirection::Backward) {
      continue;
    }
    for (std::size_t k = i; k-- > 0;) {
      if (all[k].direction == PassDirection::Forward && !has_pair[k] &&
          all[k].position == all[i].position && all[k].tool_offset_m == all[i].tool_offset_m) {
        forward_of[i] = k;
        has_pair[k] = true;
        break;
      }
    }
  }
  return forward_of;
}

}  // namespace abbe::calib::mfb
