/// Plans of `abbe plan mfb` against simulated machines: root mean square of what an identification
/// misses, by the predicted uncertainty, for each of the 21 errors (asked: 0.9 to 1.1). Bars as
/// long as the travel, shorter ones that overlap, and longer ones that are inclined.
///     bench_plan_mfb [--short]

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <ctime>
#include <map>

#include "mfb_planning.hpp"
#include "mfb_simulation.hpp"

namespace {

using namespace abbe::calib;
using namespace abbe::calib::mfb;
using namespace abbe::tests::mfb;

/// Mean squares of the errors of one name.
struct Misses {
  double achieved2 = 0.0, predicted2 = 0.0;
};

void compare(const char* what, const PlanTask& task, const std::vector<PlannedPosition>& positions,
             std::size_t machines) {
  const Plan plan = plan_of(task, positions);
  const auto prediction = predict(task.bar, plan, task.machine);
  if (!prediction) {
    fmt::print("{}: {}\n", what, prediction.error().text);
    return;
  }
  const Eigen::VectorXd u = prediction->u();
  std::map<std::string, Misses> by_name;
  double chi2_per_dof = 0.0;
  for (std::size_t seed = 0; seed < machines; ++seed) {
    std::mt19937_64 random(9000 + seed);
    const SimulatedMachine machine(random);
    ProbingOptions options;
    options.pattern = task.bar.pattern;
    const ProbedBar probed = probe(machine, plan, random, options);
    const auto found = identify(probed.bar, plan, probed.touches, task.machine);
    if (!found) {
      fmt::print("{}, machine {}: {}\n", what, seed, found.error().text);
      return;
    }
    const Eigen::VectorXd truth = machine.truth(found->observations.basis.layout());
    const auto parameters = found->model.parameters();
    for (std::size_t i = 0; i < parameters.size(); ++i) {
      const auto k = static_cast<Eigen::Index>(i);
      Misses& m = by_name[parameters[i].name];
      m.achieved2 += std::pow(parameters[i].value - truth(k), 2);
      m.predicted2 += u(k) * u(k);
    }
    chi2_per_dof += found->solution.statistics.chi2_per_dof / static_cast<double>(machines);
  }

  std::pair<double, std::string> least{1e9, ""}, most{0.0, ""};
  for (const auto& [name, m] : by_name) {
    const double ratio = std::sqrt(m.achieved2 / m.predicted2);
    least = std::min(least, {ratio, name});
    most = std::max(most, {ratio, name});
  }
  fmt::print(
      "{} ({} measurements, {} positions, {} machines): achieved / predicted {:.3f} ({}) to {:.3f} "
      "({}), worst u {:.3f} of its limit, chi2/dof {:.3f}\n",
      what, plan.measurements.size(), positions.size(), machines, least.first, least.second,
      most.first, most.second, prediction->worst, chi2_per_dof);
}

void compare_set(const char* what, NamedSet which, const PlanTask& task, std::size_t machines) {
  const auto set = named_set(which, task);
  if (!set) {
    fmt::print("{}: {}\n", what, set.error().text);
    return;
  }
  compare(what, task, set->positions, machines);
}

}  // namespace

int main(int argc, char** argv) {
  const bool brief = argc > 1 && std::strcmp(argv[1], "--short") == 0;
  const std::size_t machines = brief ? 20 : 200;
  const Vector3 travel_m = Vector3::Constant(SmoothError::kTravel_m);
  PlanTask task = paper_task();
  task.settings.tip_radius_m = 1.5e-3;
  compare_set("paper", NamedSet::Paper, task, machines);
  compare_set("rolled", NamedSet::Rolled, task, machines);
  compare_set("minimum", NamedSet::Minimum, task, machines);
  compare_set("indexed", NamedSet::Indexed, task, machines);

  const std::clock_t start = std::clock();
  const auto rolled = named_set(NamedSet::Rolled, task);
  const auto chosen = choose_set(task, rolled->positions);
  fmt::print("choice: {} candidates, {} exchanges, {:.1f} s; worst u {:.3f}, before {:.3f}\n",
             chosen->candidates, chosen->exchanged,
             static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC, chosen->prediction.worst,
             chosen->start.worst);
  compare("chosen", task, chosen->positions, machines);
  compare_set("bars of 350 mm overlap", NamedSet::Rolled, task_for(8, travel_m), machines);
  compare_set("bars of 700 mm are inclined", NamedSet::Rolled, task_for(15, travel_m), machines);
  return 0;
}
