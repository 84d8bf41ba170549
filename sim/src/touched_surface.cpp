#include "abbe/sim/touched_surface.hpp"

#include <algorithm>

#include "abbe/sim/noise.hpp"
#include "crossing.hpp"

namespace abbe::sim {

std::vector<double> edge_times_s(const TouchedSurface& surface, const PathMotion& path) {
  const auto above = [&](double t) { return path.at(t).q_m[surface.axis] > surface.surface_m; };
  std::vector<double> edges;
  for (std::size_t leg = 0; leg < path.legs(); ++leg) {
    const double before = path.leg_begin_s(leg);
    const double after = path.leg_end_s(leg);
    if (!above(before) || above(after)) continue;
    const double edge = crossing(before, after, [&](double t) { return !above(t); });
    const double jitter_s =
        surface.jitter_s * gaussian(surface.seed, NoiseStream::Probe, edges.size());
    edges.push_back(edge + surface.delay_s + jitter_s);
  }

  std::ranges::sort(edges);
  return edges;
}

}  // namespace abbe::sim
