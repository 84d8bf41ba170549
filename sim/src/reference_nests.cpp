#include "abbe/sim/reference_nests.hpp"

#include <algorithm>
#include <cmath>

#include "abbe/sim/noise.hpp"

namespace abbe::sim {

double NestVisits::round_s() const {
  const auto count = static_cast<double>(nests.size());
  return nests.empty() ? 0.0 : count * (move_s + stay_s) + move_s;
}

Beam beam_at(const NestVisits& visits, std::span<const double> rounds_s, double time_s) {
  const auto after = std::upper_bound(rounds_s.begin(), rounds_s.end(), time_s);
  if (after == rounds_s.begin() || visits.nests.empty()) return {};
  const auto round = static_cast<std::size_t>(after - rounds_s.begin()) - 1;
  const double elapsed_s = time_s - rounds_s[round];
  if (elapsed_s >= visits.round_s()) return {};

  const double visit_s = visits.move_s + visits.stay_s;
  const auto nest = static_cast<std::size_t>(elapsed_s / visit_s);
  const bool moves = elapsed_s - static_cast<double>(nest) * visit_s < visits.move_s;
  return {moves ? BeamTarget::None : BeamTarget::Nest, nest, round};
}

Eigen::Vector3d nest_position_m(const NestVisits& visits, const Beam& beam, double time_s) {
  const ReferenceNest& nest = visits.nests[beam.nest];
  const std::size_t visit = beam.round * visits.nests.size() + beam.nest;
  Eigen::Vector3d p = nest.position_m;
  if (time_s >= nest.moved_at_s) p += nest.moved_m;
  for (int k = 0; k < 3; ++k)
    p(k) += visits.repeatability_m *
            gaussian(visits.seed, NoiseStream::Nest, 3 * visit + static_cast<std::size_t>(k));
  return p;
}

}  // namespace abbe::sim
