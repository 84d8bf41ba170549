// Identifies several runs, each with another target offset: `abbe identify otf --target-mm ...`.
#include <fmt/format.h>

#include <array>
#include <charconv>

#include "abbe/base/units.hpp"
#include "abbe/calib/otf/identify/targets.hpp"
#include "abbe/config/calib_error.hpp"
#include "abbe/config/calibration_input.hpp"
#include "abbe/config/unmeasured_air.hpp"
#include "abbe/methods/otf/inputs.hpp"
#include "abbe/methods/otf/length_unit.hpp"
#include "abbe/methods/otf/time_unit.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tasks/identified_model.hpp"
#include "abbe/tasks/scales_corrected.hpp"
#include "otf_input_files.hpp"
#include "otf_run.hpp"

namespace abbe::daemon {
namespace {

struct TargetPoints {
  calib::Vector3 offset_m;
  TrackerFile tracker;
  std::string file;
};

struct TargetRuns : MachineAndPath {
  std::vector<TargetPoints> runs = {};
};

Error not_a_target(const std::string& text) {
  return {ErrorCode::Usage,
          fmt::format("--target-mm {}: must be X,Y,Z=FILE, for example 20,-15,-120=tracker1.csv; "
                      "X, Y, Z in mm",
                      text)};
}

/// Splits a text such as "20,-15,-120=tracker1.csv" into the offset and the name of the file after
/// '='.
Result<std::pair<calib::Vector3, std::string>> parse_target(const std::string& text) {
  const char* at = text.data();
  const char* const end = at + text.size();
  calib::Vector3 offset_m;
  for (int i = 0; i < 3; ++i) {
    double value_mm = 0.0;
    const auto [behind, error] = std::from_chars(at, end, value_mm);
    const char separator = i < 2 ? ',' : '=';
    if (error != std::errc{} || behind == end || *behind != separator)
      return tl::make_unexpected(not_a_target(text));
    offset_m[i] = value_mm / kMmPerM;
    at = behind + 1;
  }
  if (at == end) return tl::make_unexpected(not_a_target(text));
  return std::pair{offset_m, std::string(at, end)};
}

Result<TargetRuns> read_runs(const IdentifyOtfArguments& arguments, const Progress& progress) {
  auto read = read_machine_and_path(arguments);
  ABBE_TRY(read);

  const auto machine = otf_machine(read->config.machine);
  ABBE_TRY(machine);

  TargetRuns all{std::move(*read)};
  for (const auto& text : arguments.targets) {
    const auto target = parse_target(text);
    ABBE_TRY(target);
    auto tracker =
        read_tracker_points(arguments, target->second, all.runs.size(), [&](double fraction) {
          progress.show(fmt::format("reading {}", target->second), fraction);
        });
    ABBE_TRY(tracker);
    ABBE_TRY(check_length_unit(target->second, *tracker, all.path, machine->nodes));
    ABBE_TRY(check_time_unit(target->second, *tracker, all.path));
    ABBE_TRY(place_tracker(*tracker, arguments.tracker_centre_m(all.runs.size()), target->second,
                           arguments.centre_option));
    all.sources.push_back(tracker->source);
    all.runs.push_back({target->first, std::move(*tracker), target->second});
  }
  return all;
}

Result<void> check_runs(const IdentifyOtfArguments& arguments, TargetRuns& all) {
  ABBE_TRY(check_scales("identify otf", "a path", all.config, arguments.scales_corrected));
  all.config.machine.target_given = true;  // the offsets are given by --target-mm
  return check_path(arguments.path, all.path, all.config);
}

/// The residuals of every run.
std::vector<RunResiduals> residuals_of(const calib::otf::TargetsIdentification& found) {
  std::vector<RunResiduals> runs;
  for (std::size_t k = 0; k < found.solutions.size(); ++k)
    runs.push_back(
        calib::otf::placed_residuals(found.observations[k], found.solutions[k].residuals));
  return runs;
}

/// The common solution, with the statistics of all runs.
calib::otf::Solution of_all_runs(calib::otf::TargetsIdentification found) {
  calib::otf::Solution all = std::move(found.solutions.front());
  all.statistics = found.statistics;
  return all;
}

}  // namespace

Result<OtfOutcome> from_targets(const IdentifyOtfArguments& arguments,
                                const std::optional<ActiveDocument>& active,
                                const Progress& progress) {
  auto all = read_runs(arguments, progress);
  ABBE_TRY(all);
  apply(arguments, all->config);
  ABBE_TRY(apply_smoothness(arguments.smoothness, all->config));
  ABBE_TRY(check_runs(arguments, *all));
  const auto machine = otf_machine(all->config.machine);
  ABBE_TRY(machine);

  calib::otf::Options options = otf_options(all->runs.front().tracker.points, all->config);
  if (arguments.accept_path_orientation) options.orientation.accepted = true;
  if (arguments.segment_samples > 0) options.segment_samples = arguments.segment_samples;
  options.progress = [&](calib::otf::Stage stage, double fraction) {
    progress.show(words(stage), fraction);
  };
  for (const TargetPoints& run : all->runs) ABBE_TRY(apply_frame(run.tracker, run.file, options));
  calib::otf::Noise noise = otf_noise(all->config.machine);
  noise.u_scale = u_scale_of(arguments, all->config);

  std::vector<calib::otf::TargetRun> runs;
  for (const auto& run : all->runs)
    runs.push_back({run.tracker.points, otf_path(all->path.vertices_m), run.offset_m});
  auto found = calib::otf::identify_targets(runs, *machine, noise, options);
  if (!found) return tl::make_unexpected(error_of(found.error()));

  const auto other = comparison_model(active, all->config);
  std::vector<RunResiduals> residuals = residuals_of(*found);
  auto verdict = calib::otf::judge(found->observations, found->solutions, other.model,
                                   gate_limits(all->config.gate), options,
                                   calib::otf::held_out_into(residuals));
  if (!verdict) return tl::make_unexpected(error_of(verdict.error()));
  for (std::size_t k = 0; k < all->runs.size(); ++k)
    judge_beams(all->runs[k].tracker, found->observations[k], found->solutions[k], all->config.gate,
                *verdict);
  if (!all->config.machine.tracker_place.empty())
    verdict->notes.emplace_back(
        "the place of the tracker is not used: of several targets no offset of the ranges is kept");
  other.add_note(*verdict);
  if (auto air = unmeasured_air_text(all->config, noise.u_scale))
    verdict->notes.push_back(*std::move(air));

  std::vector<calib::otf::RangeOffset> range_offsets;
  for (const calib::otf::Solution& solution : found->solutions)
    range_offsets.push_back(solution.range_offset);
  auto outcome = outcome_of(
      {of_all_runs(std::move(*found)), std::move(*verdict), options.mode, std::move(residuals)},
      all->config, std::move(all->sources));
  outcome.range_offsets = std::move(range_offsets);
  return outcome;
}

}  // namespace abbe::daemon
