#include "abbe/daemon/vertex_readings.hpp"

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
  Eigen::Index axis = 0;
  const calib::Vector3 off_m = slowest_->reading_m - slowest_->path_m;
  off_m.cwiseAbs().maxCoeff(&axis);
  const double allowed_m = tolerance_m_ + kCoverage * slowest_->u_m(axis);
  if (std::abs(off_m(axis)) <= allowed_m) return std::nullopt;
  return fmt::format(
      "the scales contradict the path: at vertex {} {} reads {:.3f} mm, the path says {:.3f} mm, {:.3f} mm "
      "allowed "
      "([gate] path_tolerance_mm): the control drives another path than this one, or it compensates",
      slowest_->vertex, "XYZ"[axis], 1e3 * slowest_ -> reading_m(axis), 1e3 * slowest_ -> path_m(axis),
      1e3 * allowed_m);
}

}  // namespace abbe::daemon
