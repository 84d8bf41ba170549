#pragma once
/// The options of `abbe plan mfb`, and the plan that they describe.

#include <cstddef>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/calib/mfb/plan/plan.hpp"
#include "abbe/methods/mfb/bar_plan.hpp"
#include "abbe/tasks/progress.hpp"

namespace abbe::daemon {

inline constexpr double kSecondsPerMinute = 60.0;

struct PlanMfbArguments {
  std::string machine, bar, check;
  std::vector<std::string> styli;
  std::string set = "rolled", swivel = "A", rotary_at;
  bool best = false, forward_only = false;
  std::size_t exchanges = calib::mfb::ChoiceOptions{}.exchanges;
  double tip_radius_mm = 1.5, probe_um = 0.125, machine_um = 0.25;
  double temperature_C = 20.0, u_temperature_K = 0.05, overlap = calib::mfb::PlanTask{}.overlap;
  double feed_mm_per_min = 2000.0, probing_feed_mm_per_min = 240.0;
};

struct PlanInputs {
  std::string machine_name;
  calib::mfb::MfbMachine machine;
  calib::mfb::Bar bar;
};

/// The allowed values of PlanMfbArguments::set.
[[nodiscard]] std::vector<std::string> bar_plan_sets();
[[nodiscard]] Result<PlanInputs> bar_plan_inputs(const PlanMfbArguments& arguments);
/// The plan in the file of option --check, with its prediction.
[[nodiscard]] Result<BarPlan> judged_bar_plan(const PlanMfbArguments& arguments,
                                              const PlanInputs& inputs);
/// Makes a new plan.
[[nodiscard]] Result<BarPlan> plan_mfb(const PlanMfbArguments& arguments, const PlanInputs& inputs,
                                       const Progress& progress);

}  // namespace abbe::daemon
