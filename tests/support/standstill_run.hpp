#pragma once
/// A synthetic run with standstills: a machine with random tables stops at corners and random
/// positions of its volume. Deterministic from its seeds. Between two positions the speed rises
/// and falls smoothly.

#include <cmath>
#include <random>
#include <utility>
#include <vector>

#include "otf_run.hpp"

namespace abbe::tests::otf {

struct StandstillRunOptions {
  MadeRunOptions made{};  ///< seeds, noise, size of the errors, speed, rate
  std::size_t positions = 60;
  double dwell_s = 1.0;
};

/// The eight corners of the volume, then random positions.
inline std::vector<Vector3> stop_positions(const calib::otf::Machine& machine, std::size_t count,
                                           std::mt19937_64& random) {
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  std::vector<Vector3> positions;
  for (std::size_t i = 0; i < count; ++i) {
    Vector3 q;
    for (std::size_t a = 0; a < 3; ++a) {
      const auto& nodes_m = machine.nodes[a].nodes_m;
      const double share = i < 8 ? static_cast<double>(i >> a & 1U) : uniform(random);
      q(static_cast<Eigen::Index>(a)) =
          nodes_m.front() + share * (nodes_m.back() - nodes_m.front());
    }
    positions.push_back(q);
  }
  return positions;
}

/// Axis positions of a machine that stands at every position.
inline std::vector<Vector3> drive_and_stand(const std::vector<Vector3>& positions_m, double dwell_s,
                                            double speed_m_s, double rate_hz) {
  std::vector<Vector3> q;
  const auto stand = static_cast<std::size_t>(std::lround(dwell_s * rate_hz));
  q.insert(q.end(), stand, positions_m.front());
  for (std::size_t i = 1; i < positions_m.size(); ++i) {
    const Vector3 way = positions_m[i] - positions_m[i - 1];
    const auto steps = static_cast<std::size_t>(std::ceil(way.norm() / speed_m_s * rate_hz));
    for (std::size_t k = 1; k < steps; ++k) {
      const double u = static_cast<double>(k) / static_cast<double>(steps);
      q.emplace_back(positions_m[i - 1] + u * u * (3.0 - 2.0 * u) * way);
    }
    q.insert(q.end(), stand, positions_m[i]);
  }
  return q;
}

/// The samples of a machine that drives through `driven_m`; the path of the run does not change.
inline void measure_standstills(MadeRun& run, const std::vector<Vector3>& driven_m,
                                const StandstillRunOptions& wanted) {
  std::mt19937_64 noise(wanted.made.noise_seed);
  const calib::ParameterLayout layout = layout_of(run.machine);
  const Vector3& t = run.machine.target_offset_m;
  run.samples.clear();
  for (const Vector3& q :
       drive_and_stand(driven_m, wanted.dwell_s, wanted.made.speed_m_s, wanted.made.rate_hz)) {
    const Vector3 V =
        calib::volumetric_error(layout, {run.truth.data(), layout.model_size()}, q, t);
    const Vector3 p = run.T_machine_tracker.R.transpose() * (q + t + V - run.T_machine_tracker.t_m);
    run.samples.push_back({static_cast<double>(run.samples.size()) / wanted.made.rate_hz,
                           with_noise(p, run.noise, wanted.made.noise_factor, noise), true});
  }
}

inline MadeRun make_standstill_run(const StandstillRunOptions& wanted = {}) {
  std::mt19937_64 random(wanted.made.seed);
  MadeRun run;
  run.machine = coarse_machine(wanted.made.chain);
  run.path.vertices_m = stop_positions(run.machine, wanted.positions, random);
  run.options.mode = calib::otf::Mode::Standstill;
  run.options.standstill.u_repeatability_m = 0.0;  // the noise is white
  run.options.orientation.scales_agree = true;
  run.truth = random_tables(layout_of(run.machine), wanted.made.error_scale_m, random);
  run.T_machine_tracker = case_a_alignment(true);
  measure_standstills(run, run.path.vertices_m, wanted);
  return run;
}

}  // namespace abbe::tests::otf
