#include "abbe/pipeline/vertex_readings.hpp"

#include <fmt/format.h>

#include <cmath>
#include <utility>

namespace abbe::daemon {

std::optional<std::string> VertexReadings::take(const VertexReading& reading) {
  std::optional<std::string> before;
  if (slowest_ && slowest_->vertex != reading.vertex) {
    before = contradiction();
    slowest_.reset();
  }
  if (!slowest_ || reading.speed_m_per_s <= slowest_->speed_m_per_s) slowest_ = reading;
  return before;
}

std::optional<std::string> VertexReadings::contradiction() const {
  if (!slowest_ || slowest_->speed_m_per_s > kStands_m_per_s) return std::nullopt;
  constexpr double kCoverage = 3.0;
  const VertexReading& seen = *slowest_;
  const calib::Vector3 allowed_m = tolerance_m_ + (kCoverage * seen.u_m).array();
  Eigen::Index axis = 0;
  const double most =
      ((seen.reading_m - seen.path_m).array().abs() / allowed_m.array()).maxCoeff(&axis);
  if (most <= 1.0) return std::nullopt;

  return fmt::format(
      "the scales contradict the path: at vertex {} {} reads {:.3f} mm, the path has {:.3f} mm, "
      "{:.3f} mm allowed ([gate] path_tolerance_mm): the control drives another path than this "
      "one, or it compensates errors",
      seen.vertex, "XYZ"[axis], 1e3 * seen.reading_m(axis), 1e3 * seen.path_m(axis),
      1e3 * allowed_m(axis));
}

}  // namespace abbe::daemon
