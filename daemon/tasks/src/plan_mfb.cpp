#include "abbe/tasks/plan_mfb.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <numeric>
#include <optional>
#include <string_view>

#include "abbe/base/units.hpp"
#include "abbe/config/calib_error.hpp"
#include "abbe/methods/mfb/inputs.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tables/mfb_files.hpp"
#include "abbe/tasks/vector_option.hpp"

namespace abbe::daemon {
namespace {

namespace mfb = calib::mfb;

/// Reads a stylus, "x,y,z" or "x,y,z,-x": the last part is the axis along which the stem points.
Result<mfb::Stylus> parse_stylus(const std::string& text, const calib::KinematicChain& chain) {
  const auto malformed = [&] {
    return fail(
        ErrorCode::Usage,
        fmt::format("--stylus-mm \"{}\": must be x,y,z in mm, from the tool reference point "
                    "to the tip, or x,y,z and the direction of the stem: x,y,z,-x",
                    text));
  };
  const auto comma = text.rfind(',');
  const std::string last = comma == std::string::npos ? "" : text.substr(comma + 1);
  const bool directed = !last.empty() && std::isalpha(static_cast<unsigned char>(last.back())) != 0;
  const auto offset_m = parse_mm("--stylus-mm", directed ? text.substr(0, comma) : text);
  if (!offset_m) return malformed();

  mfb::Stylus stylus = mfb::stylus_of(*offset_m, chain);
  if (!directed) return stylus;
  const auto axis = std::string_view("xyz").find(last.back());
  const bool signed_well =
      last.size() == 1 || (last.size() == 2 && (last[0] == '-' || last[0] == '+'));
  if (axis == std::string_view::npos || !signed_well) return malformed();
  stylus.stem =
      (last[0] == '-' ? -1.0 : 1.0) * calib::Vector3::Unit(static_cast<Eigen::Index>(axis));
  return stylus;
}

Result<mfb::PlanTask> task_of(const PlanMfbArguments& arguments, const PlanInputs& inputs) {
  mfb::PlanTask task{.bar = inputs.bar, .machine = inputs.machine};
  for (const auto& text : arguments.styli) {
    const auto stylus = parse_stylus(text, inputs.machine.chain);
    ABBE_TRY(stylus);
    task.styli.push_back(*stylus);
  }
  task.settings.tip_radius_m = arguments.tip_radius_mm / kMmPerM;
  task.settings.noise = {.probe_m = arguments.probe_um / kUmPerM,
                         .machine_m = arguments.machine_um / kUmPerM};
  task.backward = !arguments.forward_only;
  task.overlap = arguments.overlap;
  if (inputs.bar.expansion) {
    task.temperature_K = arguments.temperature_C + kZeroCelsius_K;
    task.settings.noise.u_temperature_K = arguments.u_temperature_K;
  }
  return task;
}

mfb::TouchDrive drive_of(const PlanMfbArguments& arguments) {
  mfb::TouchDrive drive;
  drive.feed_m_per_s = arguments.feed_mm_per_min / kMmPerM / kSecondsPerMinute;
  drive.probing_feed_m_per_s = arguments.probing_feed_mm_per_min / kMmPerM / kSecondsPerMinute;
  return drive;
}

Result<std::optional<mfb::RotaryTable>> table_of(const PlanMfbArguments& arguments,
                                                 const mfb::PlanTask& task) {
  if (arguments.set != name(mfb::NamedSet::Indexed)) return std::optional<mfb::RotaryTable>{};
  mfb::RotaryTable table{.centre_m = mfb::middle_of_travel(task),
                         .swivel = arguments.swivel == "A" ? calib::Axis::X : calib::Axis::Y};
  if (!arguments.rotary_at.empty()) {
    const auto at = parse_mm("--rotary-at-mm", arguments.rotary_at);
    ABBE_TRY(at);
    table.centre_m = *at;
  }
  return std::optional{table};
}

/// Sorts the positions so that the positions of one clamping follow each other.
void order_by_clamping(std::vector<mfb::PlannedPosition>& positions,
                       std::vector<mfb::IndexedPosition>& indexed) {
  std::vector<std::size_t> order(positions.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return indexed[a].clamping < indexed[b].clamping;
  });
  const auto unordered = positions;
  const auto unordered_indexed = indexed;
  for (std::size_t i = 0; i < order.size(); ++i) {
    positions[i] = unordered[order[i]];
    indexed[i] = unordered_indexed[order[i]];
  }
}

/// Adds the prediction that follows from the measurements of the plan.
Result<BarPlan> predicted(BarPlan plan, const PlanMfbArguments& arguments,
                          const PlanInputs& inputs) {
  const auto prediction = mfb::predict(inputs.bar, plan.plan, inputs.machine);
  if (!prediction) return tl::make_unexpected(error_of(prediction.error()));
  plan.prediction = *prediction;
  plan.readings = mfb::readings_of(inputs.bar, plan.plan);
  plan.duration_s = mfb::duration_s(inputs.bar, plan.plan, drive_of(arguments));

  constexpr double kOutside_m = 0.05e-3;
  for (const auto axis : calib::kAllAxes) {
    const auto k = static_cast<Eigen::Index>(index(axis));
    const auto& nodes_m = inputs.machine.nodes[index(axis)].nodes_m;
    const double outside_m =
        std::max(nodes_m.front() - plan.readings.min_m[k], plan.readings.max_m[k] - nodes_m.back());
    if (outside_m > kOutside_m)
      plan.notes.push_back(
          fmt::format("{}: touches are up to {:.1f} mm outside [axes.{}]: check "
                      "the limits of the machine",
                      letter(axis), outside_m * kMmPerM, letter(axis)));
  }
  return plan;
}

}  // namespace

Result<PlanInputs> bar_plan_inputs(const PlanMfbArguments& arguments) {
  const auto config = load_config(arguments.machine);
  ABBE_TRY(config);
  ABBE_TRY(check_bar_machine(arguments.machine, config->machine));
  const auto machine = mfb_machine(config->machine);
  ABBE_TRY(machine);
  const auto bar = read_bar_toml(arguments.bar);
  ABBE_TRY(bar);
  return PlanInputs{config->machine.name, *machine, bar->bar};
}

Result<BarPlan> judged_bar_plan(const PlanMfbArguments& arguments, const PlanInputs& inputs) {
  const auto file = read_bar_plan_toml(arguments.check, inputs.bar);
  ABBE_TRY(file);
  BarPlan plan;
  plan.set = file->source.name;
  plan.plan = file->plan;
  return predicted(std::move(plan), arguments, inputs);
}

std::vector<std::string> bar_plan_sets() {
  std::vector<std::string> names;
  for (const auto set : mfb::kNamedSets) names.emplace_back(name(set));
  return names;
}

Result<BarPlan> plan_mfb(const PlanMfbArguments& arguments, const PlanInputs& inputs,
                         const Progress& progress) {
  const auto task = task_of(arguments, inputs);
  ABBE_TRY(task);
  const auto table = table_of(arguments, *task);
  ABBE_TRY(table);
  std::optional<calib::Vector3> centre_m;
  if (*table) centre_m = (*table)->centre_m;
  const auto named = mfb::set_named(arguments.set);
  if (!named)
    return fail(ErrorCode::Usage, fmt::format("--set: \"{}\": must be {}", arguments.set,
                                              fmt::join(bar_plan_sets(), ", ")));
  auto set = mfb::named_set(*named, *task, centre_m);
  if (!set) return tl::make_unexpected(error_of(set.error()));
  if (set->positions.empty())
    return tl::make_unexpected(Error{ErrorCode::DataInsufficient,
                                     "plan mfb: no measurement is possible with these styli",
                                     set->missing});

  BarPlan plan;
  plan.set = arguments.set;
  plan.notes = set->notes;
  if (!plan.notes.empty())
    plan.notes.emplace_back(
        "bars that are inclined or overlap are for identify mfb --estimator simultaneous, the "
        "default");
  plan.missing = set->missing;
  auto positions = set->positions;
  if (arguments.best) {
    mfb::ChoiceOptions options{.exchanges = arguments.exchanges};
    options.progress = [&](double share) { progress.show("choosing", share); };
    const auto chosen = mfb::choose_set(*task, positions, options);
    if (!chosen) return tl::make_unexpected(error_of(chosen.error()));
    positions = chosen->positions;
    plan.start = chosen->start;
    if (chosen->exchanged > 0) plan.notes.clear();
    plan.notes.push_back(fmt::format("{} exchanges of positions, {} candidates", chosen->exchanged,
                                     chosen->candidates));
  }
  if (*table) {
    plan.indexed = mfb::indexed_positions(positions, inputs.bar, **table);
    order_by_clamping(positions, plan.indexed);
  }
  plan.plan = mfb::plan_of(*task, positions);
  return predicted(std::move(plan), arguments, inputs);
}

}  // namespace abbe::daemon
