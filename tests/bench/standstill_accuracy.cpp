/// Accuracy of standstill mode and of the on-the-fly method on the same machines in the same time:
/// 200 positions with 1 s of standstill and 10 m/min between them, against the reference path at
/// the speed that takes as long. White noise (2 um, 3 urad), 500 points per second. Requirement of
/// standstill mode: rms error at most 1.05 of the Cramer-Rao bound over ten machines, mean squared
/// normalised error 0.8 to 1.2.

#include <fmt/format.h>

#include <cmath>
#include <cstring>
#include <optional>
#include <utility>

#include "abbe/calib/model/model_comparison.hpp"
#include "abbe/calib/otf/identify/identify.hpp"
#include "abbe/calib/otf/observe/segments.hpp"
#include "otf_run.hpp"

namespace {

using namespace abbe;
using calib::Vector3;
using tests::never_worse::OtfRun;

constexpr double kMicro = 1e6;

/// Sums over the grid of all runs.
struct Figures {
  double squares_m2 = 0.0, bound_m2 = 0.0, normalised = 0.0, seconds = 0.0;
  std::size_t points = 0, components = 0;

  [[nodiscard]] double rmse_m() const {
    return std::sqrt(squares_m2 / static_cast<double>(points));
  }
  [[nodiscard]] double bound_m() const { return std::sqrt(bound_m2 / static_cast<double>(points)); }
  [[nodiscard]] double mean_normalised() const {
    return normalised / static_cast<double>(components);
  }
};

/// White noise, nothing else: the bound knows of nothing else.
void leave_noise_only(OtfRun& run) {
  run.range_scale = 1.0;
  run.range_offset_m = 0.0;
  run.scale = Vector3::Ones();
  run.noise = {};
  run.rate_hz = 100.0;
}

sim::PathMotion motion_of(const OtfRun& run) {
  sim::PathPlan plan{.feed_m_per_s = run.feed_m_per_s, .dwell_s = run.dwell_s};
  for (const Vector3& q : run.driven_m) plan.vertices.push_back({q, 0.0});
  return *sim::PathMotion::plan(plan);
}

/// Sets the speed with which the path takes `seconds`.
void take_as_long(OtfRun& run, double seconds) {
  double slow = 1e-3, fast = 1.0;
  for (int i = 0; i < 50; ++i) {
    run.feed_m_per_s = 0.5 * (slow + fast);
    (motion_of(run).duration_s() > seconds ? slow : fast) = run.feed_m_per_s;
  }
}

/// V of the model minus V of the truth on a grid over the travel, as stated (datum G1).
void compare(Figures& figures, const OtfRun& run, const calib::VolumetricModel& model) {
  constexpr double kFixed_m = 1e-9;  // a smaller component is fixed by the datum
  for (const Vector3& q : calib::tensor_grid(run.machine.nodes)) {
    const calib::VolumetricError e = model.error_at(q, run.machine.target_offset_m);
    const Vector3 left_m = e.V_m - sim::error_m(run.truth, q);
    figures.squares_m2 += left_m.squaredNorm();
    figures.bound_m2 += e.cov_V_m2.trace();
    ++figures.points;
    for (Eigen::Index k = 0; k < 3; ++k) {
      if (e.cov_V_m2(k, k) > kFixed_m * kFixed_m) {
        figures.normalised += left_m(k) * left_m(k) / e.cov_V_m2(k, k);
        ++figures.components;
      }
    }
  }
}

bool identify_and_compare(Figures& figures, OtfRun run) {
  figures.seconds += motion_of(run).duration_s();
  const auto samples = tests::never_worse::measure(run);
  calib::otf::Options options;
  options.mode = run.mode;
  options.standstill.u_repeatability_m = 0.0;
  options.segment_samples = calib::otf::suitable_segment_samples(samples);
  const auto found = calib::otf::identify(samples, run.machine, {run.path_m}, run.noise, options);
  if (!found) {
    fmt::print("failed: {}\n", found.error().text);
    return false;
  }
  compare(figures, run, found->solution.model);
  return true;
}

void print(const char* mode, const Figures& f, int runs) {
  fmt::print(
      "{:<11} {:.0f} s: rms error {:.3f} um, Cramer-Rao bound {:.3f} um, ratio {:.3f}, mean "
      "squared normalised error {:.2f}\n",
      mode, f.seconds / runs, kMicro * f.rmse_m(), kMicro * f.bound_m(), f.rmse_m() / f.bound_m(),
      f.mean_normalised());
}

}  // namespace

int main(int argc, char** argv) {
  const int runs = argc > 1 && std::strcmp(argv[1], "--short") == 0 ? 2 : 40;
  Figures stands, on_the_fly;
  bool done = true;
  for (int seed = 1; seed <= runs; ++seed) {
    OtfRun run = tests::never_worse::random_standstill_run(static_cast<std::uint64_t>(seed));
    OtfRun other = tests::never_worse::random_otf_run(static_cast<std::uint64_t>(seed));
    leave_noise_only(run);
    leave_noise_only(other);
    take_as_long(other, motion_of(run).duration_s());
    done = identify_and_compare(stands, std::move(run)) && done;
    done = identify_and_compare(on_the_fly, std::move(other)) && done;
  }

  print("standstill", stands, runs);
  print("on the fly", on_the_fly, runs);
  const double ratio = stands.rmse_m() / stands.bound_m(), normalised = stands.mean_normalised();
  const bool met = done && ratio <= 1.05 && normalised >= 0.8 && normalised <= 1.2;
  fmt::print("asked of standstill mode: ratio at most 1.05, 0.8 to 1.2: {}\n", met ? "yes" : "no");
  return met ? 0 : 1;
}
