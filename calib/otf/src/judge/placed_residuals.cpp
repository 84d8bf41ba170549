#include "abbe/calib/otf/judge/placed_residuals.hpp"

namespace abbe::calib::otf {
namespace {

/// Length of the path up to each vertex.
std::vector<double> lengths_to_vertices_m(std::span<const Vector3> vertices_m) {
  std::vector<double> lengths(1, 0.0);
  for (std::size_t i = 1; i < vertices_m.size(); ++i) {
    lengths.push_back(lengths.back() + (vertices_m[i] - vertices_m[i - 1]).norm());
  }
  return lengths;
}

}  // namespace

std::vector<PlacedResidual> placed_residuals(const Observations& o, const Residuals& residuals) {
  const std::vector<double> to_vertex_m = lengths_to_vertices_m(o.vertices_m);
  std::vector<PlacedResidual> placed;
  placed.reserve(o.rows.size());

  for (std::size_t i = 0; i < o.rows.size(); ++i) {
    const Observation& row = o.rows[i];
    placed.push_back(
        {.way_m = to_vertex_m.at(row.leg) + (row.axis_position_m - o.vertices_m.at(row.leg)).norm(),
         .leg = row.leg,
         .time_s = o.segment_s.empty() ? std::nullopt : std::optional(o.segment_s.at(row.segment)),
         .axis_position_m = row.axis_position_m,
         .component = row.component,
         .sigma_m = row.sigma_m,
         .before_m = residuals.before_m.at(i),
         .after_m = residuals.after_m.at(i)});
  }

  return placed;
}

HeldOutRow held_out_into(std::span<std::vector<PlacedResidual>> runs) {
  return [runs](std::size_t run, std::size_t row, double no_compensation_m, double candidate_m) {
    runs[run].at(row).held_out = HeldOutResidual{no_compensation_m, candidate_m};
  };
}

}  // namespace abbe::calib::otf
