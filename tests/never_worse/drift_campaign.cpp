// Repeated short on-the-fly runs of random machines against one active model each: how often an
// unchanged machine raises DRIFT, and how often one does of which a table moved by 6 standard
// uncertainties of the difference of two runs. For every run the tracker is set up again, and
// ranges and scales have other errors. Also with input that the test does not expect.
// Arguments: [MACHINES [UNCHANGED [MOVED [FIRST_SEED]]]], by default 2, 100, 20 runs.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <string>
#include <vector>

#include "abbe/calib/model/model_drift.hpp"
#include "abbe/calib/otf/identify/identify.hpp"
#include "abbe/calib/otf/observe/segments.hpp"
#include "figure.hpp"
#include "otf_run.hpp"
#include "random_numbers.hpp"

namespace abbe::tests::never_worse {
namespace {

constexpr double kSigmas = 6.0;

/// About two minutes instead of eight.
OtfRun short_run(std::uint64_t seed) {
  OtfRun run = random_otf_run(seed);
  run.feed_m_per_s = 20.0 / 60.0;
  return run;
}

calib::Result<calib::otf::Identification> identified(OtfRun& run, calib::otf::Options& options) {
  const auto samples = measure(run);
  options.segment_samples = calib::otf::suitable_segment_samples(samples);
  options.orientation = run.evidence;
  return calib::otf::identify(samples, run.machine, {run.path_m}, run.noise, options);
}

struct Raised {
  std::string error;
  bool shows_machine = false;  ///< of the verdict
  calib::DriftTest drift;
  [[nodiscard]] bool raised() const { return shows_machine && drift.drifted; }
};

Raised next_run(OtfRun run, std::uint64_t number, const calib::VolumetricModel& active) {
  run.random.seed(1'000'003 * number + 17);
  set_up_again(run);
  calib::otf::Options options;
  const auto found = identified(run, options);
  if (!found) return {.error = found.error().text};
  const auto verdict =
      calib::otf::judge(found->observations, found->solution, &active, {}, options);
  if (!verdict) return {.error = verdict.error().text};
  const auto drift = calib::test_drift(found->solution.model, active);
  if (!drift) return {.error = drift.error().text};
  return {.shows_machine = calib::shows_machine(*verdict), .drift = *drift};
}

/// The same values at the nodes, curved between them: no table represents these errors exactly.
void curve_between_nodes(OtfRun& run) {
  for (sim::AxisTruth& axis : run.truth.axes) {
    for (sim::ErrorFunction& error : axis.error) {
      error = sim::ErrorFunction({error.nodes_m().begin(), error.nodes_m().end()},
                                 {error.values().begin(), error.values().end()}, sim::Shape::Cubic);
    }
  }
}

/// The same volume on other legs.
void mirror_path_in_x(OtfRun& run) {
  const auto& range = run.truth.axes[0].range;
  for (std::vector<Vector3>* path : {&run.path_m, &run.driven_m}) {
    for (Vector3& q : *path) q.x() = range.min_m + range.max_m - q.x();
  }
}

/// Standard uncertainty of the difference of two such runs where move_table() changes most.
double u_of_difference(const calib::VolumetricModel& active, const std::string& table) {
  double u = 0.0;
  std::size_t nodes = 0, at = 0;
  for (const calib::Parameter& p : active.parameters()) nodes += p.name == table ? 1 : 0;
  const auto motion = calib::error_motion(table);
  const bool bow = motion && calib::is_straightness(*motion);
  for (const calib::Parameter& p : active.parameters()) {
    if (p.name != table) continue;
    if (at++ == (bow ? nodes / 2 : nodes - 1)) u = std::sqrt(2.0) * p.u;
  }
  return u;
}

struct Counts {
  int runs = 0, raised = 0, named = 0, others = 0, not_shown = 0, errors = 0;
  double tables = 0.0;
  std::string last_error;

  void count(const Raised& r, const std::string& table) {
    ++runs;
    if (!r.error.empty()) {
      ++errors;
      last_error = r.error;
      return;
    }
    not_shown += r.shows_machine ? 0 : 1;
    if (!r.raised()) return;
    ++raised;
    const std::vector<std::string> drifted = r.drift.drifted_tables();
    for (const std::string& name : drifted) {
      (name == table ? named : others) += 1;
    }
    tables += static_cast<double>(drifted.size());
  }
  void print(const std::string& what) const {
    fmt::print("{:<42} {:>5} {:>7} {:>6} {:>7} {:>7.1f} {:>10} {:>7} {}\n", what, runs, raised,
               named, others, raised > 0 ? tables / raised : 0.0, not_shown, errors,
               last_error.substr(0, 80));
    std::fflush(stdout);
  }
};

struct Scenario {
  std::string name;
  std::function<void(OtfRun&)> put_in;
};

std::vector<Scenario> unexpected() {
  return {
      {"warm: every axis longer by 20 um/m",
       [](OtfRun& r) {
         for (const char* table : {"EXX", "EYY", "EZZ"}) {
           const auto& range = r.truth.axes[calib::index(calib::error_motion(table)->axis)].range;
           move_table(r, table, 20e-6 * 0.5 * (range.max_m - range.min_m));
         }
       }},
      {"warms up during the run, 20 um/m",
       [](OtfRun& r) {
         r.truth.thermal = {.expansion_per_m = Vector3::Constant(20e-6),
                            .shift_m = Vector3::Zero(),
                            .time_constant_s = 900.0};
       }},
      {"one of 1000 samples off by 0.2 mm", [](OtfRun& r) { r.spikes = 1e-3; }},
      {"noise correlated over 1 s", [](OtfRun& r) { r.correlation_s = 1.0; }},
      {"five times the noise", [](OtfRun& r) { r.sigma_range_m *= 5.0, r.sigma_angle_rad *= 5.0; }},
      {"another path: driven backwards",
       [](OtfRun& r) {
         std::reverse(r.path_m.begin(), r.path_m.end());
         std::reverse(r.driven_m.begin(), r.driven_m.end());
       }},
      {"another path: mirrored in X", mirror_path_in_x},
      {"another tool offset, 1 mm", [](OtfRun& r) { r.machine.target_offset_m.z() += 1e-3; }},
  };
}

}  // namespace

int run_drift_campaign(int machines, int unchanged, int moved, std::uint64_t first_seed) {
  fmt::print("{:<42} {:>5} {:>7} {:>6} {:>7} {:>7} {:>10} {:>7}\n", "change", "runs", "DRIFT",
             "named", "others", "tables", "not shown", "errors");
  Counts none, all;
  for (int m = 0; m < machines; ++m) {
    const OtfRun base = short_run(first_seed + static_cast<std::uint64_t>(m));
    OtfRun first = base;
    calib::otf::Options options;
    const auto found = identified(first, options);
    if (!found) {
      fmt::print("machine {}: {}\n", m, found.error().text);
      continue;
    }
    const calib::VolumetricModel& active = found->solution.model;
    std::uint64_t number = 1000 * (first_seed + static_cast<std::uint64_t>(m));
    const auto run_of = [&](int runs, const std::function<void(OtfRun&)>& put_in,
                            const std::string& what, const std::string& table) {
      Counts counts;
      for (int i = 0; i < runs; ++i) {
        OtfRun run = base;
        put_in(run);
        const Raised r = next_run(run, ++number, active);
        counts.count(r, table);
        (table.empty() ? none : all).count(r, table);
      }
      counts.print(what);
    };

    run_of(
        unchanged, [](OtfRun&) {}, fmt::format("machine {}: none", m), "");
    const Counts of_unchanged = none;
    const calib::Axis first_axis = base.machine.chain.order_w_to_t()[0];
    const char letter = calib::letter(first_axis);
    const std::string roll{'E', static_cast<char>('A' + calib::index(first_axis)), letter};
    for (const std::string& table :
         {std::string("EXX"), std::string("EYX"), roll, std::string("EC0Y")}) {
      const double by = kSigmas * u_of_difference(active, table);
      run_of(
          moved, [&](OtfRun& r) { move_table(r, table, by); },
          fmt::format("machine {}: {} by {:.2f}", m, table, 1e6 * by), table);
    }
    for (const Scenario& s : unexpected()) {
      run_of(moved / 4, s.put_in, fmt::format("machine {}: {}", m, s.name), "");
    }
    none = of_unchanged;

    OtfRun curved = base;
    curve_between_nodes(curved);
    OtfRun first_of_curved = curved;
    const auto of_curved = identified(first_of_curved, options);
    if (!of_curved) continue;
    Counts same_path, other_path;
    for (int i = 0; i < unchanged / 5; ++i) {
      same_path.count(next_run(curved, ++number, of_curved->solution.model), "");
      OtfRun other = curved;
      mirror_path_in_x(other);
      other_path.count(next_run(other, ++number, of_curved->solution.model), "");
    }
    same_path.print(fmt::format("machine {}: curved between nodes", m));
    other_path.print(fmt::format("machine {}: curved, another path", m));
  }

  print_figure("drift: unchanged runs that raise DRIFT", "0 of 100", "{} of {}", none.raised,
               none.runs);
  print_figure("drift: runs with a table moved by 6 sigma that raise DRIFT", "19 of 20", "{} of {}",
               all.raised, all.runs);
  print_figure("drift: of these, the moved table is named", "most", "{}, {} other tables named",
               all.named, all.others);
  return none.raised == 0 && 20 * all.raised >= 19 * all.runs ? 0 : 1;
}

}  // namespace abbe::tests::never_worse

int main(int argc, char** argv) {
  const auto number = [&](int i, int otherwise) {
    return argc > i ? std::atoi(argv[i]) : otherwise;
  };
  return abbe::tests::never_worse::run_drift_campaign(number(1, 2), number(2, 100), number(3, 20),
                                                      static_cast<std::uint64_t>(number(4, 1)));
}
