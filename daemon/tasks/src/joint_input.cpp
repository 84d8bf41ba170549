#include "abbe/tasks/joint_input.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <initializer_list>
#include <utility>

#include "abbe/base/input_file.hpp"
#include "abbe/config/calib_error.hpp"
#include "abbe/methods/evemu/identification.hpp"
#include "abbe/methods/otf/inputs.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tables/parts_file.hpp"
#include "abbe/tasks/evemu_input.hpp"
#include "abbe/tasks/identify_otf.hpp"
#include "abbe/tasks/opened_recording.hpp"
#include "joint_bar.hpp"

namespace abbe::daemon {
namespace {

Error in_part(const std::string& name, Error error) {
  error.text = fmt::format("{}: {}", name, error.text);
  return error;
}

std::string file_names(std::initializer_list<std::string> files) {
  std::string text;
  for (const auto& file : files)
    if (!file.empty())
      text += (text.empty() ? "" : ", ") + std::filesystem::path(file).filename().string();
  return text;
}

/// Adds the files that are not yet in the list.
void add_sources(JointInput& input, const std::vector<InputFile>& more) {
  for (const InputFile& file : more)
    if (std::ranges::find(input.sources, file) == input.sources.end())
      input.sources.push_back(file);
}

IdentifyOtfArguments arguments_of(const IdentifyJointArguments& all, const RunFiles& files) {
  IdentifyOtfArguments run;
  run.machine = all.machine;
  run.path = files.path;
  run.tracker = files.tracker;
  run.encoder = files.encoder;
  run.recording = files.recording;
  run.estimator = all.estimator;
  run.u_scale_ppm = all.u_scale_ppm;
  run.scales_corrected = all.scales_corrected;
  run.accept_path_orientation = all.accept_path_orientation;
  run.target_offset_m = files.target_offset_m;
  run.tracker_position_m = files.tracker_position_m;
  if (files.tracker_centre_m) run.tracker_centres_m = {*files.tracker_centre_m};
  run.centre_option = "tracker_centre_mm of the [[run]]";
  return run;
}

/// The offset of the ranges that the run shares with other runs.
Result<std::optional<calib::TrackerPlace>> shared_offset(const RunFiles& files,
                                                         const calib::otf::Solution& solution) {
  if (files.range_offset.empty()) return std::nullopt;
  if (!solution.offset_in_model)
    return fail(
        ErrorCode::BadInput,
        fmt::format("{}: range_offset = \"{}\" needs u_range_offset_um > 0 of the tracker, and a "
                    "run without reference nests: otherwise the offset is not estimated",
                    files.name, files.range_offset));
  return calib::TrackerPlace{files.range_offset, *solution.offset_in_model};
}

/// Adds a note for every run whose range_offset no other run has.
void note_unshared_offsets(const std::vector<RunFiles>& runs, std::vector<PartFacts>& facts) {
  for (std::size_t k = 0; k < runs.size(); ++k) {
    const std::string& name = runs[k].range_offset;
    if (!name.empty() && std::ranges::count(runs, name, &RunFiles::range_offset) == 1)
      facts[k].verdict.notes.push_back(
          fmt::format("range_offset = \"{}\" is that of this run only: its offset of the ranges "
                      "counts as independent; check the spelling in parts.toml",
                      name));
  }
}

constexpr std::string_view kSimulated = "daemon.simulated";

/// The entries that take_recorded_readings() takes from a part, except whether its devices are
/// simulated.
MeaningEntries recorded_readings(const Config& part) {
  MeaningEntries taken;
  take_entries(taken, part.meaning.readings, {"machine", "axes", "target", "model", "thermal"});
  std::erase_if(taken, [](const MeaningEntry& entry) { return entry.key == kSimulated; });
  return taken;
}

/// Refused if the readings of the part have another meaning than those of the parts before: one
/// model cannot correct both.
Result<void> require_same_readings(const std::string& name, const Config& part, JointInput& input) {
  auto readings = recorded_readings(part);
  if (!input.recorded_readings) input.recorded_readings = readings;
  if (readings == *input.recorded_readings) return {};
  auto [changes, changed, added] = difference(*input.recorded_readings, readings);
  changes.insert(changes.end(), changed.begin(), changed.end());
  if (!added.empty()) changes.push_back(keys_text(added) + " was not given");
  return fail(ErrorCode::BadInput,
              fmt::format("{}: its axis readings have another meaning than those of the first "
                          "recorded run: {}",
                          name, listed(changes)));
}

/// Takes the meaning of the readings from a recorded part. If the devices of one part are
/// simulated, the whole model counts as a model of simulated devices.
void take_readings_of(const Config& part, Config& config) {
  const auto* earlier = value_of(config.meaning.readings, kSimulated);
  const std::string devices = earlier != nullptr ? *earlier : "false";
  take_recorded_readings(config, &part);
  if (devices != "false") set_entry(config.meaning.readings, kSimulated, devices);
}

Result<void> add_run(const IdentifyJointArguments& arguments, const RunFiles& files,
                     JointInput& input, const Progress& progress) {
  const IdentifyOtfArguments of_run = arguments_of(arguments, files);
  auto run = files.recording.empty() ? identify_files(of_run, std::nullopt, progress)
                                     : identify_recorded(of_run, progress);
  if (!run) return tl::make_unexpected(in_part(files.name, run.error()));
  if (!files.recording.empty()) {
    ABBE_TRY(require_same_readings(files.name, run->config, input));
    take_readings_of(run->config, input.config);
  }
  const auto& solution = run->found.solution;
  if (!input.common) {
    auto common = calib::joint::tables_of(solution.model);
    if (!common) return tl::make_unexpected(in_part(files.name, error_of(common.error())));
    input.common = std::move(*common);
  }

  const auto offset = shared_offset(files, solution);
  ABBE_TRY(offset);
  const calib::joint::CommonEffects effects{.u_ranges = run->noise.u_scale,
                                            .ranges_of = files.instrument,
                                            .u_axis_scale = run->noise.u_axis_scale,
                                            .place = *offset};
  auto part = calib::joint::part_of_run(files.name, solution.model, *input.common, effects);
  if (!part) return tl::make_unexpected(error_of(part.error()));

  // In this case, the data determine less than three quarters of the variance of the offset.
  constexpr double kHalf = 0.5;
  if (!*offset && solution.range_offset.u_m > kHalf * run->noise.u_range_offset_m)
    run->verdict.notes.emplace_back(
        "the offset of the ranges is known from its stated uncertainty only; it counts as "
        "independent between runs: state a smaller u_range_offset_um, use a longer path, or, "
        "for runs with the same tracker, reflector and home position, range_offset in parts.toml");

  input.observations.push_back(
      calib::otf::without_run_effects(std::move(run->found.observations), solution));
  input.runs.push_back({input.parts.size(), &input.observations.back(), effects});
  input.parts.push_back(std::move(*part));
  input.facts.push_back(
      {files.name, "otf", file_names({files.path, files.tracker, files.encoder, files.recording}),
       solution.statistics.observations, solution.model, std::move(run->verdict)});
  add_sources(input, run->sources);

  return {};
}

EvemuInputArguments arguments_of(const IdentifyJointArguments& all, const ArrayFiles& files) {
  EvemuInputArguments array;
  array.machine = all.machine;
  array.touches = files.touches;
  array.calibrator = files.calibrator;
  array.errors = files.errors;
  array.positions = files.positions;
  array.artefact_C = files.artefact_C;
  if (files.artefact_C) array.u_artefact_K = files.u_artefact_K;
  array.tip_offset_m = files.tip_offset_m;
  array.scales_corrected = all.scales_corrected;
  return array;
}

/// The verdict on the ball array alone. If the array alone does not determine a model, the verdict
/// has a note instead of reasons.
calib::Verdict verdict_of_array(const EvemuInput& array) {
  const auto candidate = identify_with_array(
      {array.observations, {.limits = gate_limits(array.config.gate), .accept_shape_only = true}},
      nullptr);
  if (!candidate) return {.notes = {"not judged by itself: " + candidate.error().text}};
  return candidate->verdict;
}

Result<void> add_array(const IdentifyJointArguments& arguments, const ArrayFiles& files,
                       JointInput& input, const Progress& progress) {
  progress.show(fmt::format("evaluating {}", files.name), 0.0);
  auto array = read_evemu_input(arguments_of(arguments, files), progress);
  if (!array) return tl::make_unexpected(in_part(files.name, array.error()));

  // Parts that were measured with the same array have the same errors of its calibration.
  calib::joint::ArrayOptions options{.s_m = files.s_centre_m,
                                     .linearised_at = input.facts.front().own_model->U()};
  if (!files.calibrator.empty()) options.array = file_names({files.calibrator});
  auto part = calib::joint::part_of_array(files.name, array->observations, *input.common, options);
  if (!part) return tl::make_unexpected(error_of(part.error()));

  input.facts.push_back(
      {files.name, "evemu", file_names({files.touches, files.calibrator, files.errors}),
       3 * array->observations.rows.size(), std::nullopt, verdict_of_array(*array)});
  input.parts.push_back(std::move(*part));
  add_sources(input, array->sources);

  return {};
}

}  // namespace

Result<JointInput> read_joint_input(const IdentifyJointArguments& arguments,
                                    const Progress& progress) {
  auto config = load_config(arguments.machine);
  ABBE_TRY(config);
  if (config->otf.backlash != OtfBacklash::None)
    return fail(ErrorCode::BadInput,
                fmt::format("{}: otf.backlash: must be \"none\" for identify joint: half the "
                            "backlash is in the uncertainty of every run and does not average out",
                            arguments.machine));
  if (config->otf.smoothness_m)
    return fail(ErrorCode::BadInput,
                fmt::format("{}: otf.smoothness_um: must not be given for identify joint: every "
                            "run would contain the prior, and all together would count it once "
                            "for each of them",
                            arguments.machine));
  const auto source = hashed_file(arguments.machine);
  ABBE_TRY(source);
  const auto files = read_parts_toml(arguments.parts);
  ABBE_TRY(files);

  JointInput input;
  input.config = std::move(*config);
  input.sources = {*source, files->source};
  for (const RunFiles& run : files->runs) ABBE_TRY(add_run(arguments, run, input, progress));
  note_unshared_offsets(files->runs, input.facts);
  for (const ArrayFiles& array : files->arrays)
    ABBE_TRY(add_array(arguments, array, input, progress));
  for (const BarFiles& files_of_bar : files->bars) {
    progress.show(fmt::format("evaluating {}", files_of_bar.name), 0.0);
    if (const auto added = add_bar(arguments, files_of_bar, input); !added)
      return tl::make_unexpected(in_part(files_of_bar.name, added.error()));
  }

  return input;
}

}  // namespace abbe::daemon
