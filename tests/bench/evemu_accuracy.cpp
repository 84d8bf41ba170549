// Question: how much of a machine's errors remains after correction with each estimator of the
// ball-array method, and are the stated uncertainties right? Machine: the weak-stiffness machine of
// [Li OMM] Table 3 (errors of 3.3 mm) with the ball positions of the reference data, evaluated
// at 2964 points, which include regions without balls in the flatter layout. R_resmag: remaining
// error divided by the error of the machine. Requirements for the mean R_resmag of bayes-pose
// relative to that of ols with the same seeds: 8 um white noise: <= 0.80; with 0.15 mrad pose
// rotations: <= 0.52; near-planar layout with 0.32 mrad, where ols has points above 1: no point
// above 1. Simulated touches: rms after the best-fit rotation about Ball1 <= 0.07 mm (ols 0.23).
// Coverage of the 95 % intervals over 300 seeds: 93 to 97 % per component, also with an uncertain
// array (2 um, 5 urad, 0.5 K). Hyper-parameters and solution: <= 0.1 s on one core.
//
//   bench_evemu_accuracy [seeds = 100] [coverage seeds = 300]

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <ctime>

#include "evemu_artefact.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::evemu;
using namespace abbe::tests::evemu;

bool missed = false;

void ask(bool reached, const char* what) {
  if (!reached) {
    std::printf("MISSED: %s\n", what);
    missed = true;
  }
}

enum class Grid { Reference, OwnHull };

void compare(const char* what, const Layout& layout, const Noise& noise, unsigned seeds,
             double asked, Grid where = Grid::Reference) {
  const Field V = table3_machine();
  const std::vector<Vector3> grid = where == Grid::Reference ? reference_grid() : hull_grid(layout);
  std::array<double, 3> mean{}, worst{}, rms{};
  double s_m = 0, w_rad = 0;

  for (unsigned seed = 1; seed <= seeds; ++seed) {
    const Observations o = simulated(layout, V, noise, seed);
    const Solution ols = *solve(o, {.estimator = Estimator::Ols});
    const Solution ridge = *solve(o, {.estimator = Estimator::Ridge}), bayes = *solve(o);
    const std::array<Remaining, 3> left{remaining(V, raw_field_of(ols), grid),
                                        remaining(V, field_of(ridge), grid),
                                        remaining(V, field_of(bayes), grid)};
    for (std::size_t i = 0; i < 3; ++i) {
      mean[i] += left[i].mean_R / seeds;
      rms[i] += left[i].rms_m / seeds;
      worst[i] = std::max(worst[i], left[i].max_R);
    }
    s_m += bayes.statistics.s_m / seeds;
    w_rad += bayes.statistics.w_rad / seeds;
  }

  std::printf("%-28s %5zu points  mean R ols %.5f ridge %.5f bayes %.5f  ratio %.3f (asked %.2f)\n",
              what, grid.size(), mean[0], mean[1], mean[2], mean[2] / mean[0], asked);
  std::printf(
      "%28s rms um ols %.2f ridge %.2f bayes %.2f  max R ols %.3f ridge %.3f bayes %.3f  s %.2f um "
      "w %.3f "
      "mrad\n",
      "", 1e6 * rms[0], 1e6 * rms[1], 1e6 * rms[2], worst[0], worst[1], worst[2], 1e6 * s_m,
      1e3 * w_rad);
  ask(mean[2] <= asked * mean[0], "ratio of bayes to ols");
  ask(worst[2] <= 1.0, "no point above 1");
}

/// Compares with SCAD, with the grid of [Li OMM] and folds by position. The fits of SCAD and ols
/// are evaluated before V(Ball1) = 0 is set.
void against_scad(unsigned seeds) {
  const Field V = table3_machine();
  for (const Noise noise : {Noise{8e-6, 0.0}, Noise{8e-6, 0.15e-3}}) {
    double scad_R = 0, bayes_R = 0, scad_s = 0;
    for (unsigned seed = 1; seed <= seeds; ++seed) {
      const Observations o = simulated(reference_layout(), V, noise, seed);
      SolveOptions options{.estimator = Estimator::Scad};
      options.sparse.bootstrap_runs = 2;
      const auto start = std::chrono::steady_clock::now();
      const Solution scad = *solve(o, options), bayes = *solve(o);
      scad_s +=
          std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count() / seeds;
      const auto grid = evaluation_grid(bayes.model.validity());
      scad_R += remaining(V, raw_field_of(scad), grid).mean_R / seeds;
      bayes_R += remaining(V, field_of(bayes), grid).mean_R / seeds;
    }
    std::printf("scad, %.2f mrad, %u seeds: mean R scad %.5f bayes %.5f, %.2f s a grid search\n",
                1e3 * noise.w_rad, seeds, scad_R, bayes_R, scad_s);
  }
}

void touch_chain(unsigned seeds) {
  const Field V = table3_machine();
  const Layout layout = reference_layout();
  const std::vector<Touch> exact = reference_touches("touched_noiseless.csv");

  struct Way {
    const char* name;
    SolveOptions options;
    double R = 0, rms_m = 0, free_rms_m = 0;
  };

  std::array<Way, 4> ways{Way{"ols", {Estimator::Ols}}, Way{"ridge", {Estimator::Ridge, false}},
                          Way{"bayes, centres", {Estimator::BayesPose, false}},
                          Way{"bayes, touches", {Estimator::BayesPose, true}}};

  for (unsigned seed = 1; seed <= seeds; ++seed) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> noise(0, 3e-6);
    std::vector<Touch> touches = exact;
    for (Touch& t : touches) {
      for (double& x : t.p_m) {
        x += noise(random);
      }
    }
    const Observations o = *observe(touches, reference_calibrator(), reference_machine());
    for (Way& way : ways) {
      const Solution s = *solve(o, way.options);
      const std::vector<Vector3> grid = evaluation_grid(s.model.validity(), layout);
      const Field model = field_of(s);
      const Remaining true_array = remaining(V, model, grid);
      way.R += true_array.mean_R / seeds;
      way.rms_m += true_array.rms_m / seeds;
      way.free_rms_m += remaining(V, turned_to(V, model, grid), grid).rms_m / seeds;

      if (seed == 1) {
        std::printf("  %s: s %.2f um w %.3f mrad removed rotation %.3f %.3f %.3f mrad\n", way.name,
                    1e6 * s.statistics.s_m, 1e3 * s.statistics.w_rad,
                    1e3 * s.rotation.removed_rad.x(), 1e3 * s.rotation.removed_rad.y(),
                    1e3 * s.rotation.removed_rad.z());
      }
    }
  }

  ask(ways.back().free_rms_m <= 0.07e-3, "touch chain, 0.07 mm");
  for (const Way& way : ways) {
    std::printf(
        "touch chain, %-28s mean R %.3f, rms %.3f mm; without the best-fit rotation rms %.4f mm\n",
        way.name, way.R, 1e3 * way.rms_m, 1e3 * way.free_rms_m);
  }
}

struct Coverage {
  std::array<std::size_t, 3> in{};
  std::size_t all = 0;
};

/// Does not change the array.
struct ExactArray {
  Observations operator()(Observations o, const Layout&, unsigned) const { return o; }
};

/// Adds random errors of the array, another set for every seed: 2 um per ball coordinate, 5 urad
/// per block and 0.5 K of steel. `stated_too`: the fit is told these uncertainties.
struct UncertainArray {
  bool stated_too = true;
  Observations operator()(Observations o, const Layout& layout, unsigned seed) const {
    const Calibrator c = stated(reference_calibrator(), 2e-6, 5e-6);
    ArtefactUncertainty u =
        uncertainty_of(c, Expansion{.alpha_per_K = 11.5e-6, .u_temperature_K = 0.5});
    std::mt19937_64 random(seed + 5000);
    const Calibrator found = drawn(c, u.u_scale(), random);
    if (!stated_too) u = uncertainty_of(reference_calibrator(), std::nullopt);
    return with_array(std::move(o), layout, found, u);
  }
};

template <class Machine, class Array = ExactArray>
void coverage(const char* what, const Machine& machine_of, const Noise& noise, unsigned seeds,
              bool asked, const Array& array = {}) {
  const Layout layout = reference_layout();
  std::array<Coverage, 3> found;
  const std::array<Estimator, 3> estimators{Estimator::Ols, Estimator::Ridge, Estimator::BayesPose};

  for (unsigned seed = 1; seed <= seeds; ++seed) {
    const Field V = machine_of(seed);
    const Observations o = array(simulated(layout, V, noise, seed + 1000), layout, seed);
    for (std::size_t e = 0; e < estimators.size(); ++e) {
      const Solution s = *solve(o, {.estimator = estimators[e], .use_touches = false});
      const std::vector<Vector3> grid = evaluation_grid(s.model.validity(), layout);
      for (std::size_t i = seed % 29; i < grid.size(); i += 29) {
        const VolumetricError at = s.model.error_at(grid[i], Vector3::Zero());
        const Vector3 off = V(grid[i]) - V(o.ball1_m) - at.V_m;
        for (Eigen::Index c = 0; c < 3; ++c) {
          found[e].in[static_cast<std::size_t>(c)] +=
              std::abs(off(c)) <= 1.959964 * std::sqrt(at.cov_V_m2(c, c));
        }
        ++found[e].all;
      }
    }
  }

  bool covered = true;
  for (std::size_t e = 0; e < estimators.size(); ++e) {
    covered = true;  // after the loop: the result of the last estimator, bayes-pose
    std::printf("coverage %-34s %-10s", what, std::string(name(estimators[e])).c_str());
    for (const std::size_t in : found[e].in) {
      const double percent = 100.0 * static_cast<double>(in) / static_cast<double>(found[e].all);
      std::printf("  %5.2f %%", percent);
      covered = covered && percent >= 93.0 && percent <= 97.0;
    }
    std::printf("\n");
  }

  constexpr unsigned kEnough = 300;  // with fewer seeds, 2 % is within the statistical scatter
  ask(!asked || covered || seeds < kEnough, "bayes covers 93 to 97 %");
}

/// A machine with random coefficients, drawn from the prior that the estimator bayes-pose assumes.
Field drawn_machine(unsigned seed) {
  const ScaledDesign design =
      *ScaledDesign::of(reference_machine().chain, 3, {{0.26, 0.14, 0.05}, {0.35, 0.2, 0.05}});
  const HyperParameters h{.s_d_m = 0.5e-3, .rho = 0.4, .s_a_m = 0.5e-3};
  const Eigen::VectorXd variance = prior_variances(PriorKind::BayesPose, design, 0, h);
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  Eigen::VectorXd c = variance.cwiseSqrt();

  for (double& value : c) {
    value *= normal(random);
  }

  c = zero_at(design, {-0.09, 0.14, 0.03}) * c;
  const PolynomialModel model =
      *PolynomialModel::of(design, {-0.09, 0.14, 0.03}, c, Eigen::MatrixXd::Zero(45, 45));

  return [model](const Vector3& q) { return model.V_at(q); };
}

/// Table 3 plus errors that polynomials of order 3 cannot represent: sag under a travelling weight,
/// and a periodic pitch error of a screw.
Field imperfect_machine(unsigned) {
  const Field V = table3_machine();
  return [V](const Vector3& q) -> Vector3 {
    const double sag_m = 10e-6 * std::exp(-std::pow((q.x() - 0.25) / 0.15, 2)) * (0.5 + q.y());
    const double pitch_m = 2e-6 * std::sin(2 * std::numbers::pi * q.x() / 0.020);
    return V(q) + Vector3(pitch_m, 0, -sag_m);
  };
}

void speed() {
  const Field V = table3_machine();
  const Observations o = simulated(reference_layout(), V, {8e-6, 0.15e-3}, 7);
  std::array<double, 21> seconds{};
  int evaluations = 0;

  for (double& s : seconds) {
    const std::clock_t start = std::clock();  // processor time: excludes other processes
    const Solution solution = *solve(o);
    s = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
    evaluations = solution.hyper->evaluations;
  }

  std::nth_element(seconds.begin(), seconds.begin() + 10, seconds.end());
  ask(seconds[10] <= 0.1, "100 ms");
  std::printf("hyper-parameters and solution: %.1f ms, %d evaluations (limit 100 ms, ratio %.2f)\n",
              1e3 * seconds[10], evaluations, seconds[10] / 0.1);
}

}  // namespace

int main(int argc, char** argv) {
  const auto seeds = static_cast<unsigned>(argc > 1 ? std::atoi(argv[1]) : 100);
  const auto coverage_seeds = static_cast<unsigned>(argc > 2 ? std::atoi(argv[2]) : 300);
  speed();
  compare("8 um white", reference_layout(), {8e-6, 0.0}, seeds, 0.80);
  compare("8 um, 0.15 mrad", reference_layout(), {8e-6, 0.15e-3}, seeds, 0.52);
  compare("8 um, 0.32 mrad, tilt x 0.5", reference_layout(0.5), {8e-6, 0.32e-3}, seeds, 1.0);
  compare("8 um, 0.32 mrad, tilt x 0.4", reference_layout(0.4), {8e-6, 0.32e-3}, seeds, 1.0);

  // Flatter layouts are compared only inside the hull of the balls. Outside the hull the model
  // reports inside = false, and there is no requirement.
  compare("the same x 0.3, inside", reference_layout(0.3), {8e-6, 0.32e-3}, seeds, 1.0,
          Grid::OwnHull);
  compare("the same x 0.1, inside", reference_layout(0.1), {8e-6, 0.32e-3}, seeds, 1.0,
          Grid::OwnHull);
  against_scad(std::min(seeds, 5u));
  touch_chain(std::min(seeds, 20u));
  coverage("prior machine, 8 um", drawn_machine, {8e-6, 0.0}, coverage_seeds, true);
  coverage("prior machine, 8 um, 0.15 mrad", drawn_machine, {8e-6, 0.15e-3}, coverage_seeds, true);
  coverage(
      "Table 3, 8 um", [](unsigned) { return table3_machine(); }, {8e-6, 0.0}, coverage_seeds,
      false);
  coverage(
      "Table 3, 8 um, 0.15 mrad", [](unsigned) { return table3_machine(); }, {8e-6, 0.15e-3},
      coverage_seeds, false);

  // The array's errors also enlarge the residuals, and so the estimated noise s and pose rotations
  // w. They therefore count twice in the uncertainty, and the coverage is somewhat above 95 %.
  coverage("prior machine, uncertain array", drawn_machine, {3e-6, 0.0}, coverage_seeds, true,
           UncertainArray{});
  coverage("the same, not stated", drawn_machine, {3e-6, 0.0}, coverage_seeds, false,
           UncertainArray{false});
  coverage("Table 3 + sag + pitch, 8 um", imperfect_machine, {8e-6, 0.0}, coverage_seeds, false);

  return missed ? 1 : 0;
}
