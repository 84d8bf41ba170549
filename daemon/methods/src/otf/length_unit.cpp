#include "abbe/methods/otf/length_unit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "abbe/base/units.hpp"
#include "abbe/calib/geometry/usual_mistakes.hpp"
#include "otf/vector_of.hpp"

namespace abbe::daemon {
namespace {

using calib::Vector3;

/// Rms distance from the mean; 0 without points.
double spread_m(const std::vector<Vector3>& points_m) {
  const auto n = static_cast<double>(points_m.size());
  Vector3 mean = Vector3::Zero();
  for (const Vector3& p : points_m) mean += p / n;
  double squares = 0.0;
  for (const Vector3& p : points_m) squares += (p - mean).squaredNorm() / n;
  return std::sqrt(squares);
}

double diagonal_m(const calib::MachineNodes& travel) {
  Vector3 lengths;
  for (std::size_t a = 0; a < travel.size(); ++a)
    lengths(static_cast<Eigen::Index>(a)) = travel[a].nodes_m.back() - travel[a].nodes_m.front();
  return lengths.norm();
}

/// The ratio of the larger to the smaller value.
double ratio(double a, double b) {
  return std::max(a / b, b / a);
}

}  // namespace

Result<void> check_length_unit(const std::filesystem::path& file, const TrackerFile& tracker,
                               const PathFile& path, const calib::MachineNodes& travel) {
  constexpr double kSameSize = 2.0, kSpreadOfTravel = 0.3;
  std::vector<Vector3> measured_m, vertices_m;
  for (const auto& point : tracker.points)
    if (point.valid) measured_m.push_back(point.p_tracker_m);
  for (const auto& vertex : path.vertices_m) vertices_m.push_back(vector_of(vertex));
  const double measured = spread_m(measured_m), nominal = spread_m(vertices_m);
  if (!(measured > 0.0 && nominal > 0.0)) return {};

  const double expected = kSpreadOfTravel * diagonal_m(travel);
  const bool of_path = ratio(nominal, expected) > ratio(measured, expected);
  const double factor = of_path ? measured / nominal : nominal / measured;
  for (const calib::UnitMistake& unit : calib::unit_mistakes())
    if (ratio(factor, unit.factor) < kSameSize)
      return fail(ErrorCode::BadInput,
                  fmt::format("{}: the points of the tracker spread by {:.4g} mm (rms about their "
                              "centre), the path of {} by {:.4g} mm; they fit with {} ({})",
                              of_path ? path.source.name : file.string(), kMmPerM * measured,
                              path.source.name, kMmPerM * nominal, unit.text,
                              of_path ? "path" : "tracker"));
  return {};
}

}  // namespace abbe::daemon
