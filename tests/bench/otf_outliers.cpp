// Question: how much do outliers, beam breaks and another reflector change the model of on-the-fly
// calibration, and does its stated uncertainty hold? Requirements:
// - case A, five draws of 1 % outliers of 0.2 mm with six beam breaks of 0.3 to 3 s: mean error
//   within 15 % of that of the run without them;
// - simulated machines: the same, and a mean squared normalised error of 0.8 to 1.2;
// - without faults no sample is excluded.
// "all samples" is the estimate without setting aside. ABBE_REF_DIR names the folder of the
// reference data, by default beside the clone.
//
//   bench_otf_outliers [machines = 10] [first seed = 1]

#include <array>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <functional>
#include <string>
#include <vector>

#include "abbe/calib/internal/geometry/rigid_body_model.hpp"
#include "abbe/calib/model/model_comparison.hpp"
#include "abbe/calib/otf/identify/identify.hpp"
#include "otf_accuracy.hpp"
#include "otf_reference.hpp"
#include "stream_faults.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::otf;
using namespace abbe::tests;
using namespace abbe::tests::otf;
using otf_accuracy::noise_only;
using otf_accuracy::OtfRun;
using otf_accuracy::Sums;

constexpr double kOutlier_m = 0.2e-3;
bool missed = false;

void ask(bool reached, const std::string& what) {
  if (!reached) {
    std::printf("MISSED: %s\n", what.c_str());
    missed = true;
  }
}

struct StreamFault {
  const char* name;
  std::function<void(Stream&, std::mt19937_64&)> put_in;
  bool is_asked = true;
};

const std::vector<StreamFault>& faults() {
  static const std::vector<StreamFault> all{
      {"none", [](Stream&, auto&) {}},
      {"outliers 1 %", [](Stream& s, auto& r) { add_outliers(s, 0.01, kOutlier_m, r); }},
      {"outliers 5 %", [](Stream& s, auto& r) { add_outliers(s, 0.05, kOutlier_m, r); }},
      {"six breaks", [](Stream& s, auto& r) { add_breaks(s, 6, 0.3, 3.0, r); }},
      {"outliers 1 % and six breaks",
       [](Stream& s, auto& r) {
         add_outliers(s, 0.01, kOutlier_m, r);
         add_breaks(s, 6, 0.3, 3.0, r);
       }},
      {"50 clusters of 50 ms",
       [](Stream& s, auto& r) { add_clusters(s, 50, 0.05, kOutlier_m, r); }},
      {"20 clusters of 300 ms", [](Stream& s, auto& r) { add_clusters(s, 20, 0.3, kOutlier_m, r); },
       false},
      {"ranges 1 %", [](Stream& s, auto& r) { add_range_outliers(s, 0.01, kOutlier_m, r); }},
      {"outliers 1 % of 20 um", [](Stream& s, auto& r) { add_outliers(s, 0.01, 20e-6, r); }},
      {"spikes 1 % of 1 m", [](Stream& s, auto& r) { add_outliers(s, 0.01, 1.0, r); }},
      {"other reflector for 5 s",
       [](Stream& s, auto& r) { add_other_target(s, 5.0, 0.0, 0.3, r); }},
  };
  return all;
}

/// Mean error of a model of case A on the grid of the nodes, datum G1.
double mean_error_m(const VolumetricModel& model) {
  const Machine machine = case_a_machine();
  const auto layout = *ParameterLayout::observable_with_one_target(machine.chain, machine.nodes);
  const Eigen::VectorXd truth = case_a_tables(TableColumn::Truth);
  std::vector<Vector3> left;
  for (const Vector3& q : tensor_grid(machine.nodes)) {
    left.push_back(
        model.V_at(q, machine.target_offset_m) -
        volumetric_error(layout, {truth.data(), layout.model_size()}, q, machine.target_offset_m));
  }
  return vector_statistics(left).mean_m;
}

Result<Identification> of_all_samples(const Stream& samples, const Machine& machine,
                                      const Path& path, const Noise& noise,
                                      const Options& options) {
  return make_segments(samples, options).and_then([&](const SegmentSeries& series) {
    return identify_segments(series, machine, path, noise, options);
  });
}

/// Mean error over five draws of the fault; infinite if a run is refused.
void case_a_with(const StreamFault& fault, const Stream& stream, double& clean_m) {
  constexpr int kDraws = 5;
  Options options;
  options.estimator = Estimator::Simultaneous;
  double error_m = 0.0, of_all_m = 0.0, aside = 0.0;
  const std::clock_t start = std::clock();
  for (int draw = 1; draw <= kDraws; ++draw) {
    Stream samples = stream;
    std::mt19937_64 random(static_cast<std::uint64_t>(draw));
    fault.put_in(samples, random);
    const auto found = identify(samples, case_a_machine(), case_a_path(), {}, options);
    if (!found) {
      std::printf("  %-28s refused: %s\n", fault.name, found.error().text.c_str());
      ask(!fault.is_asked, fault.name);
      return;
    }
    error_m += mean_error_m(found->solution.model) / kDraws;
    aside += static_cast<double>(found->observations.set_aside.samples()) / kDraws;
    const auto all = of_all_samples(samples, case_a_machine(), case_a_path(), {}, options);
    of_all_m += all ? mean_error_m(all->solution.model) / kDraws : INFINITY;
  }

  clean_m = clean_m > 0.0 ? clean_m : error_m;
  std::printf(
      "  %-28s mean error %.4f um, %.3f of the clean run, all samples %.4f um, "
      "%.0f excluded (%.1f s)\n",
      fault.name, 1e6 * error_m, error_m / clean_m, 1e6 * of_all_m, aside,
      static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC);
  ask(!fault.is_asked || error_m <= 1.15 * clean_m, std::string("case A, ") + fault.name);
}

void case_a() {
  const auto file = big_file("caseA_stream_noisy.i32");
  if (!file) {
    std::printf("case A: its stream is not there, nothing measured (set ABBE_REF_DIR)\n");
    missed = true;
    return;
  }
  std::printf("case A with noise, mean of five draws\n");
  const Stream stream = read_stream(*file);
  double clean_m = 0.0;
  for (const StreamFault& fault : faults()) {
    case_a_with(fault, stream, clean_m);
  }
}

struct Simulated {
  Sums robust, all;
  std::size_t set_aside = 0, refused = 0;
};

void simulate(const StreamFault& fault, std::uint64_t first_seed, std::uint64_t machines,
              double& clean_m) {
  Simulated sums;
  for (std::uint64_t seed = first_seed; seed < first_seed + machines; ++seed) {
    OtfRun run = noise_only(seed, 0.0);
    Stream samples = never_worse::measure(run);
    fault.put_in(samples, run.random);
    Options options;
    options.estimator = Estimator::Simultaneous;
    options.segment_samples = suitable_segment_samples(samples);
    const Path path{run.path_m};
    const auto found = identify(samples, run.machine, path, run.noise, options);
    if (!found) {
      std::printf("  seed %d: %s\n", static_cast<int>(seed), found.error().text.c_str());
      ++sums.refused;
      continue;
    }
    sums.robust.add(run, found->solution.model);
    sums.set_aside += found->observations.set_aside.samples();
    if (const auto all = of_all_samples(samples, run.machine, path, run.noise, options)) {
      sums.all.add(run, all->solution.model);
    }
  }

  sums.robust.print(fault.name);
  sums.all.print("   all samples");
  std::printf("   %zu samples excluded, %zu runs refused\n", sums.set_aside, sums.refused);
  if (std::string(fault.name) == "none") {
    clean_m = sums.robust.rms_m();
    ask(sums.set_aside == 0, "no sample of a sound run is excluded");
    ask(sums.robust.over_bound() <= 1.02, "white noise: 1.02 of the Cramer-Rao bound");
  }
  ask(!fault.is_asked || sums.robust.rms_m() <= 1.15 * clean_m,
      std::string("simulated, error: ") + fault.name);
  const double normalised = sums.robust.mean_normalised();
  ask(!fault.is_asked || (normalised >= 0.8 && normalised <= 1.2),
      std::string("simulated, normalised error: ") + fault.name);
}

}  // namespace

int main(int argc, char** argv) {
  const auto machines = static_cast<std::uint64_t>(argc > 1 ? std::atoi(argv[1]) : 10);
  const auto first_seed = static_cast<std::uint64_t>(argc > 2 ? std::atoi(argv[2]) : 1);
  case_a();
  std::printf("%d machines at 100 Hz\n", static_cast<int>(machines));
  double clean_m = 0.0;
  for (const StreamFault& fault : faults()) {
    simulate(fault, first_seed, machines, clean_m);
  }
  return missed ? 1 : 0;
}
