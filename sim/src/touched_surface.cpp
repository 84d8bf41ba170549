#include "abbe/sim/touched_surface.hpp"

#include <algorithm>

#include "abbe/sim/noise.hpp"

namespace abbe::sim {

std::vector<double> edge_times_s(const TouchedSurface& surface, const PathMotion& path) {
  constexpr int kHalvings = 60;  // of one leg: to the last bit of a double
  const auto above = [&](double t) { return path.at(t).q_m[surface.axis] > surface.surface_m; };
  std::vector<double> edges;
  for (std::size_t leg = 0; leg < path.legs(); ++leg) {
    double before = path.leg_begin_s(leg);
    double after = path.leg_end_s(leg);
    if (!above(before) || above(after)) continue;
    for (int i = 0; i < kHalvings; ++i) {
      const double middle = 0.5 * (before + after);
      (above(middle) ? before : after) = middle;
    }
    const double jitter_s = surface.jitter_s * gaussian(surface.seed, NoiseStream::Probe, edges.size());
    edges.push_back(after + surface.delay_s + jitter_s);
  }
  std::ranges::sort(edges);
  return edges;
}

}  // namespace abbe::sim
