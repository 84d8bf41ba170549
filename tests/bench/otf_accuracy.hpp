#pragma once
/// Simulated runs of on-the-fly calibration whose only error is the noise of the tracker, and how
/// far the identified models are from the truth, relative to what they state.

#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "../never_worse/otf_run.hpp"
#include "abbe/calib/model/model_comparison.hpp"
#include "abbe/calib/otf/judge/lack_of_fit.hpp"
#include "abbe/sim/random_truth.hpp"
#include "abbe/sim/truth_machine.hpp"

namespace abbe::tests::otf_accuracy {

using calib::Vector3;
using never_worse::OtfRun;

/// A random machine of 30 um mean error, whose run has no other errors than the tracker's noise.
/// Larger errors add the second order of the exact transforms, which no model V = M B U contains
/// (0.05 um at 100 um) and no bound for it. `chain`: empty keeps the random order of the axes.
inline OtfRun noise_only(std::uint64_t seed, double correlation_s, const std::string& chain = {},
                         sim::Shape shape = sim::Shape::Linear) {
  OtfRun run = never_worse::random_otf_run(seed);
  if (!chain.empty()) {
    run.truth.order = *sim::parse_chain(chain);
    run.machine.chain = *calib::KinematicChain::parse(chain);
  }
  run.noise = {};
  run.range_scale = 1.0;
  run.range_offset_m = 0.0;
  run.scale = Vector3::Ones();
  run.correlation_s = correlation_s;
  run.truth =
      sim::random_truth(run.truth, {.seed = run.random(), .mean_error_m = 30e-6, .shape = shape});
  return run;
}

/// The points of correction_size(): at most about 9 nodes per axis, with both ends.
inline std::vector<Vector3> points_of_the_bound(const calib::MachineNodes& nodes) {
  constexpr std::size_t kCells = 8;
  calib::MachineNodes few = nodes;
  for (calib::AxisNodes& axis : few) {
    const std::vector<double> all = std::move(axis.nodes_m);
    axis.nodes_m.clear();
    const std::size_t step = (all.size() - 1 + kCells - 1) / kCells;
    for (std::size_t i = 0; i + 1 < all.size(); i += step) {
      axis.nodes_m.push_back(all[i]);
    }
    axis.nodes_m.push_back(all.back());
  }
  return calib::tensor_grid(few);
}

/// Sums over machines of the squares of errors and of their stated uncertainties.
struct Sums {
  double error_m2 = 0.0, bound_m2 = 0.0;  ///< after the best-fit rigid motion
  double normalised = 0.0;                ///< (component of V / u)^2, datum G1
  std::size_t machines = 0, components = 0;

  void add(const OtfRun& run, const calib::VolumetricModel& model) {
    add(run, model, points_of_the_bound(run.machine.nodes));
  }
  void add(const OtfRun& run, const calib::VolumetricModel& model,
           const std::vector<Vector3>& positions) {
    constexpr double kFixed_m = 1e-9;  // a component below it is fixed by the datum
    std::vector<Vector3> points, left;
    for (const Vector3& q : positions) {
      const calib::VolumetricError e = model.error_at(q, run.machine.target_offset_m);
      points.push_back(q + run.machine.target_offset_m);
      left.push_back(e.V_m - sim::error_m(run.truth, q));
      for (Eigen::Index k = 0; k < 3; ++k) {
        const double u_m2 = e.cov_V_m2(k, k);
        if (u_m2 > kFixed_m * kFixed_m) {
          normalised += left.back()(k) * left.back()(k) / u_m2;
          ++components;
        }
      }
    }

    const double rms_m = calib::rigid_free(points, left)->rigid_free.rms_m;
    const double u_m = calib::otf::correction_size(model).u_m;
    error_m2 += rms_m * rms_m;
    bound_m2 += u_m * u_m;
    ++machines;
  }

  [[nodiscard]] double rms_m() const { return std::sqrt(error_m2 / static_cast<double>(machines)); }
  [[nodiscard]] double over_bound() const { return std::sqrt(error_m2 / bound_m2); }
  [[nodiscard]] double mean_normalised() const {
    return normalised / static_cast<double>(components);
  }
  void print(const char* what) const {
    std::printf("  %-28s rms error %.4f um, %.3f of the stated, mean squared normalised %.3f\n",
                what, 1e6 * rms_m(), over_bound(), mean_normalised());
  }
};

}  // namespace abbe::tests::otf_accuracy
