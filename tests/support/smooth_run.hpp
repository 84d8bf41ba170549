#pragma once
/// A run along the first legs of a path, with dense nodes, of a machine whose tables are as smooth
/// as a prior states: bends are normal deviates, constants and slopes are anything.

#include <cmath>
#include <cstddef>

#include "otf_run.hpp"

namespace abbe::tests::otf {

struct SmoothRunOptions {
  unsigned seed = 1;
  double bend_m = 1e-6;  ///< standard deviation of the second difference of nodes 50 mm apart
  double distance_m = 0.05;
  std::size_t legs = 40;
  double noise_factor = 1.0;
};

/// One table: the second differences of neighbours scatter with `sigma`.
inline void draw_smooth_table(Eigen::Ref<Eigen::VectorXd> table, double sigma, double slope,
                              std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  table(0) = slope * normal(random);
  table(1) = table(0) + slope * normal(random);
  for (Eigen::Index i = 2; i < table.size(); ++i) {
    table(i) = 2.0 * table(i - 1) - table(i - 2) + sigma * normal(random);
  }
}

/// Datum G1.
inline Eigen::VectorXd smooth_tables(const calib::otf::Machine& machine,
                                     const SmoothRunOptions& wanted) {
  std::mt19937_64 random(wanted.seed);
  const calib::ParameterLayout layout = layout_of(machine);
  Eigen::VectorXd U = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(layout.fit_size()));
  const double per_distance = std::pow(wanted.distance_m / 0.05, 1.5);
  for (const calib::Table& table : layout.tables()) {
    const double sigma =
        wanted.bend_m * per_distance * (is_rotation(table.motion.motion) ? 2.0 : 1.0);
    draw_smooth_table(U.segment(static_cast<Eigen::Index>(table.offset),
                                static_cast<Eigen::Index>(layout.node_count(table.motion.axis))),
                      sigma, 5e-6, random);
  }
  return calib::to_datum(calib::ModelDatum::G1, layout, std::array{machine.target_offset_m}, U)
      ->head(static_cast<Eigen::Index>(layout.model_size()));
}

inline void measure_smooth_run(MadeRun& run, const SmoothRunOptions& wanted) {
  measure_run(
      run,
      {.noise_seed = wanted.seed + 1000, .noise_factor = wanted.noise_factor, .speed_m_s = 0.2});
}

inline MadeRun smooth_run(const SmoothRunOptions& wanted) {
  MadeRun run;
  run.machine = case_a_machine();
  run.machine.nodes = {*calib::equidistant_nodes(-0.3, 0.3, wanted.distance_m),
                       *calib::equidistant_nodes(-0.25, 0.25, wanted.distance_m),
                       *calib::equidistant_nodes(-0.4, 0.0, wanted.distance_m)};
  run.path = case_a_path();
  run.path.vertices_m.resize(std::min(run.path.vertices_m.size(), wanted.legs + 1));
  run.options.segment_samples = 10;  // 8 mm
  run.options.orientation.scales_agree = true;
  run.T_machine_tracker = case_a_alignment(true);
  run.truth = smooth_tables(run.machine, wanted);
  measure_smooth_run(run, wanted);
  return run;
}

}  // namespace abbe::tests::otf
