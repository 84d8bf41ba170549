#include "abbe/methods/otf/path_readings.hpp"

#include <fmt/format.h>

#include <limits>
#include <optional>
#include <set>

#include "abbe/methods/otf/acquisition.hpp"
#include "abbe/pipeline/vertex_readings.hpp"
#include "otf/vector_of.hpp"

namespace abbe::daemon {
namespace {

using calib::Vector3;

/// The machine has reached a vertex if it comes within this distance, as in a live run.
const double kNear_m = AcquisitionOptions{}.vertex_tolerance_m;

/// The reading closest to the next vertex that the machine has not reached yet.
struct Closest {
  double distance_m = std::numeric_limits<double>::infinity();
  double time_s = 0.0;
  Vector3 reading_m = Vector3::Zero();

  void take(const EncoderRow& row, const Vector3& vertex_m) {
    const Vector3 q_m = vector_of(row.reading_m);
    const double d_m = (q_m - vertex_m).norm();
    if (d_m < distance_m) *this = {d_m, row.time_s, q_m};
  }
};

double speed_m_per_s(std::span<const EncoderRow> readings, std::size_t i) {
  const std::size_t before = i > 0 ? i - 1 : i, after = i > 0 ? i : i + 1;
  const Vector3 way = vector_of(readings[after].reading_m) - vector_of(readings[before].reading_m);
  return way.norm() / (readings[after].time_s - readings[before].time_s);
}

/// False if a neighbour of vertex `i` is so near that the readings do not show at which of the two
/// vertices the machine is.
bool is_isolated(std::span<const AxisPosition> path_m, std::size_t i) {
  const auto far = [&](std::size_t a, std::size_t b) {
    return (vector_of(path_m[a]) - vector_of(path_m[b])).norm() > 2.0 * kNear_m;
  };
  return (i == 0 || far(i - 1, i)) && (i + 1 == path_m.size() || far(i, i + 1));
}

Error not_reached(const std::string& file, std::size_t vertex, const AxisPosition& q_m,
                  const Closest& closest) {
  return {ErrorCode::BadInput,
          fmt::format("{}: the scales do not reach vertex {} of the path, ({:.3f}, {:.3f}, {:.3f}) "
                      "mm: the closest reading is {:.3f} mm away, ({:.3f}, {:.3f}, {:.3f}) mm, "
                      "{:.3f} s after the first one",
                      file, vertex, 1e3 * q_m[0], 1e3 * q_m[1], 1e3 * q_m[2],
                      1e3 * closest.distance_m, 1e3 * closest.reading_m.x(),
                      1e3 * closest.reading_m.y(), 1e3 * closest.reading_m.z(), closest.time_s)};
}

}  // namespace

Result<std::size_t> compare_with_path(const std::string& file, std::span<const EncoderRow> readings,
                                      std::span<const AxisPosition> path_m, double tolerance_m) {
  if (readings.size() < 2)
    return fail(ErrorCode::BadInput, fmt::format("{}: fewer than 2 readings", file));
  VertexReadings at_vertices(tolerance_m);

  const auto refuse = [&](const std::string& contradiction) {
    return fail(ErrorCode::BadInput, fmt::format("{}: {}", file, contradiction));
  };

  std::size_t next = 0;  // the vertices before this index were reached
  std::set<std::size_t> stood;
  Closest closest;

  for (std::size_t i = 0; i < readings.size(); ++i) {
    const Vector3 q_m = vector_of(readings[i].reading_m);
    if (next < path_m.size()) {
      closest.take(readings[i], vector_of(path_m[next]));
      if (closest.distance_m <= kNear_m) {
        ++next;
        closest = {};
      }
    }
    const std::size_t vertex = next - 1;
    if (next == 0 || (q_m - vector_of(path_m[vertex])).norm() > kNear_m ||
        !is_isolated(path_m, vertex))
      continue;
    const double speed = speed_m_per_s(readings, i);
    if (speed <= VertexReadings::kStands_m_per_s) stood.insert(vertex);
    const VertexReading reading{.vertex = vertex,
                                .reading_m = q_m,
                                .path_m = vector_of(path_m[vertex]),
                                .speed_m_per_s = speed};
    if (const auto contradiction = at_vertices.take(reading)) return refuse(*contradiction);
  }

  if (next < path_m.size()) return tl::unexpected(not_reached(file, next, path_m[next], closest));
  if (const auto contradiction = at_vertices.contradiction()) return refuse(*contradiction);
  return stood.size();
}

}  // namespace abbe::daemon
