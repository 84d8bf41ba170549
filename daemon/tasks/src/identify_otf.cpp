#include "abbe/tasks/identify_otf.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numbers>
#include <optional>
#include <utility>

#include "abbe/base/input_file.hpp"
#include "abbe/base/units.hpp"
#include "abbe/base/wall_clock.hpp"
#include "abbe/calib/otf/solve/other_beams.hpp"
#include "abbe/config/unmeasured_air.hpp"
#include "abbe/methods/otf/document.hpp"
#include "abbe/methods/otf/inputs.hpp"
#include "abbe/methods/otf/length_unit.hpp"
#include "abbe/methods/otf/path_readings.hpp"
#include "abbe/methods/otf/time_unit.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tables/input_files.hpp"
#include "abbe/tasks/accepted_reasons.hpp"
#include "abbe/tasks/encoder_clock.hpp"
#include "abbe/tasks/scales_corrected.hpp"
#include "abbe/tasks/vector_option.hpp"
#include "argument_checks.hpp"
#include "otf_input_files.hpp"
#include "otf_run.hpp"

namespace abbe::daemon {

namespace otf = calib::otf;

std::string_view words(otf::Stage stage) {
  switch (stage) {
    case otf::Stage::Observe:
      return "averaging segments";
    case otf::Stage::Align:
      return "aligning";
    case otf::Stage::Solve:
      return "solving";
    case otf::Stage::Judge:
      return "judging";
  }
  return "";
}

void judge_beams(const TrackerFile& points, const otf::Observations& observations,
                 const otf::Solution& solution, const GateConfig& gate, calib::Verdict& verdict) {
  if (points.frame == TrackerFile::Frame::Spherical) return;
  const auto other = otf::find_other_beams(observations, solution);
  if (!other) return;
  const calib::Vector3 at_mm = points.centre_m * kMmPerM;
  constexpr double kDegrees = 180.0 / std::numbers::pi;
  auto text = fmt::format(
      "the noise of the points is smallest along ({:.2f}, {:.2f}, {:.2f}) of their frame "
      "({:.2f} um, across {:.2f} um), {:.0f} degrees from beams from ({:.0f}, {:.0f}, {:.0f}) mm, "
      "where the tracker is stated to stand",
      other->direction.x(), other->direction.y(), other->direction.z(), other->along_m * kUmPerM,
      other->across_m * kUmPerM, other->angle_rad * kDegrees, at_mm.x(), at_mm.y(), at_mm.z());
  if (gate.accepts(otf::kOtherBeams)) {
    verdict.notes.push_back(std::move(text));
    return;
  }
  verdict.accepted = false;
  verdict.refuse(
      otf::kOtherBeams,
      text + fmt::format(": state where it stands in this frame; if it does stand there and "
                         "the machine vibrates so, [gate] accept = [\"{}\"]",
                         otf::kOtherBeams));
}

Result<void> apply_frame(const TrackerFile& points, const std::string& file,
                         otf::Options& options) {
  if (points.frame != TrackerFile::Frame::Parallel) return {};
  options.orientation.up.reset();
  if (options.nests.nests.empty()) return {};
  return fail(
      ErrorCode::BadInput,
      fmt::format("{}: the positions of [[tracker.nest]] are in the frame of the tracker, and "
                  "the points are not",
                  file));
}

OtfOutcome outcome_of(OtfCandidate candidate, const Config& config,
                      std::vector<InputFile> sources) {
  auto document = otf_document(candidate, config, std::move(sources), utc_now());
  const auto& s = candidate.solution.statistics;
  return {std::move(document),
          std::move(candidate.verdict),
          s.segments,
          s.segments_used,
          {candidate.solution.range_offset},
          candidate.solution.synchronisation,
          candidate.solution.smoothness};
}

Result<MachineAndPath> read_machine_and_path(const IdentifyOtfArguments& arguments) {
  auto config = load_config(arguments.machine);
  ABBE_TRY(config);
  ABBE_TRY(accept_also(arguments.accept, *config));
  auto machine = hashed_file(arguments.machine);
  ABBE_TRY(machine);
  auto path = read_path_csv(arguments.path);
  ABBE_TRY(path);
  std::vector<InputFile> sources{std::move(*machine), path->source};
  return MachineAndPath{std::move(*config), std::move(*path), std::move(sources)};
}

namespace {

struct Files : MachineAndPath {
  TrackerFile tracker;
  std::optional<EncoderFile> encoder = {};
};

/// BadInput in standstill mode for a file with about one row per position. Its rows are mean
/// values, which abbe does not read.
Result<void> check_no_means(const IdentifyOtfArguments& arguments, const TrackerFile& tracker,
                            const MachineAndPath& read) {
  constexpr std::size_t kLeastPerPosition = 2;
  const bool standstills = arguments.mode.empty() ? read.config.otf.mode == OtfMode::Standstill
                                                  : arguments.mode == "standstill";
  const std::size_t rows = tracker.points.size(), positions = read.path.vertices_m.size();
  if (!standstills || rows >= kLeastPerPosition * positions) return {};
  return fail(ErrorCode::BadInput,
              fmt::format("{}: {} rows for the {} positions of {}: one row for each is the mean of "
                          "a standstill. Means are not read, because they do not show their "
                          "scatter; export every measurement, at least 3 in 0.1 s of each stop",
                          arguments.tracker, rows, positions, read.path.source.name));
}

Result<Files> read_files(const IdentifyOtfArguments& arguments, const Progress& progress) {
  auto read = read_machine_and_path(arguments);
  ABBE_TRY(read);
  auto tracker = read_tracker_points(arguments, arguments.tracker, 0, [&](double fraction) {
    progress.show("reading the tracker", fraction);
  });
  ABBE_TRY(tracker);
  ABBE_TRY(check_no_means(arguments, *tracker, *read));
  const auto machine = otf_machine(read->config.machine);
  ABBE_TRY(machine);
  ABBE_TRY(check_length_unit(arguments.tracker, *tracker, read->path, machine->nodes));
  ABBE_TRY(place_tracker(*tracker, arguments.tracker_centre_m(0), arguments.tracker,
                         arguments.centre_option));
  ABBE_TRY(check_time_unit(arguments.tracker, *tracker, read->path));
  Files files{std::move(*read), std::move(*tracker)};
  files.sources.push_back(files.tracker.source);
  if (arguments.encoder.empty()) return files;

  auto encoder = read_scale_readings(
      arguments, [&](double fraction) { progress.show("reading the scales", fraction); });
  ABBE_TRY(encoder);
  ABBE_TRY(check_time_unit(arguments.encoder, *encoder, files.path));
  files.sources.push_back(encoder->source);
  files.encoder = std::move(*encoder);
  return files;
}

/// Compares the readings of the scales with the path at every vertex where the machine stood still.
/// Returns the number of these vertices; 0 without an encoder file. An error if readings contradict
/// the path.
Result<std::size_t> vertices_compared(const IdentifyOtfArguments& arguments, const Files& files) {
  if (!files.encoder) return 0;
  return compare_with_path(arguments.encoder, files.encoder->rows, files.path.vertices_m,
                           files.config.gate.path_tolerance_m);
}

}  // namespace

Result<OtfFromFiles> identify_files(const IdentifyOtfArguments& arguments,
                                    const std::optional<ActiveDocument>& active,
                                    const Progress& progress) {
  auto files = read_files(arguments, progress);
  ABBE_TRY(files);
  apply(arguments, files->config);
  ABBE_TRY(apply_smoothness(arguments.smoothness, files->config));
  ABBE_TRY(check_scales("identify otf", "a path", files->config, arguments.scales_corrected));
  ABBE_TRY(check_path(arguments.path, files->path, files->config));
  const auto compared = vertices_compared(arguments, *files);
  ABBE_TRY(compared);
  ABBE_TRY(otf_machine(files->config.machine));
  OtfTask task{.points = {},
               .path = otf_path(files->path.vertices_m),
               .noise = otf_noise(files->config.machine),
               .options = otf_options(files->tracker.points, files->config)};
  task.points = std::move(files->tracker.points);
  otf::Options& options = task.options;
  if (arguments.accept_path_orientation) options.orientation.accepted = true;
  if (files->encoder) options.orientation.scales_agree = true;
  ABBE_TRY(apply_frame(files->tracker, arguments.tracker, options));
  if (arguments.segment_samples > 0) options.segment_samples = arguments.segment_samples;
  options.progress = [&](otf::Stage stage, double fraction) {
    progress.show(words(stage), fraction);
  };
  task.noise.u_scale = u_scale_of(arguments, files->config);
  if (files->encoder) task.scales = encoder_log(files->encoder->rows, arguments.encoder_u_time_us);

  const auto other = comparison_model(active, files->config);
  auto run = identify_otf(task, files->config, other.model);
  if (!run && options.mode == otf::Mode::Standstill)
    run.error().text = fmt::format("{}: {}", arguments.tracker, run.error().text);
  ABBE_TRY(run);
  auto& [noise, found, verdict, residuals] = *run;
  if (auto& clocks = found.solution.synchronisation; clocks && files->encoder)
    clocks->clock = clock_of_files(clocks->clock, files->tracker.times, files->encoder->times);
  judge_beams(files->tracker, found.observations, found.solution, files->config.gate, verdict);
  other.add_note(verdict);
  if (files->encoder && *compared == 0)
    verdict.notes.emplace_back(
        "the scales were compared with the path to 2 mm only: the machine stops at no vertex");
  if (auto air = unmeasured_air_text(files->config, noise.u_scale))
    verdict.notes.push_back(*std::move(air));

  return OtfFromFiles{
      std::move(files->config), std::move(files->sources), noise, options.mode, std::move(found),
      std::move(verdict),       std::move(residuals)};
}

namespace {

Result<void> check_words(const IdentifyOtfArguments& arguments) {
  ABBE_TRY(require_word("--mode", arguments.mode, {"on-the-fly", "standstill"}));
  ABBE_TRY(
      require_word("--estimator", arguments.estimator.value_or(""), {"two-step", "simultaneous"}));
  ABBE_TRY(require_word("--tables", arguments.tables,
                        {calib::kLinearBasis, calib::kCubicBasis, calib::kNotAKnotCubicBasis}));
  return require_word("--backlash", arguments.backlash, {"none", "per-table", "forward-backward"});
}

/// Usage unless exactly one source is given: a recording, or path and tracker, or path and several
/// targets.
Result<void> check_sources(const IdentifyOtfArguments& arguments) {
  const bool has_files = !arguments.tracker.empty() || !arguments.targets.empty();
  if (!has_files && arguments.recording.empty())
    return fail(ErrorCode::Usage,
                "identify otf needs --machine, --path and --tracker (or several --target-mm), or "
                "--recording");
  if (!arguments.recording.empty())
    return require_none("--recording",
                        {{"--path", !arguments.path.empty()},
                         {"--tracker", !arguments.tracker.empty()},
                         {"--target-mm", !arguments.targets.empty()},
                         {"--encoder", !arguments.encoder.empty()},
                         {"--mode", !arguments.mode.empty()},
                         {"--u-scale-ppm", arguments.u_scale_ppm.has_value()},
                         {"--tracker-unit", !arguments.tracker_unit.empty()},
                         {"--tracker-points-per-s", arguments.tracker_points_per_s.has_value()},
                         {"--scales-corrected", arguments.scales_corrected}});
  ABBE_TRY(require_all("identify otf", {{"--machine", !arguments.machine.empty()},
                                        {"--path", !arguments.path.empty()}}));
  if (arguments.targets.empty()) return {};
  return require_none("--target-mm", {{"--tracker", !arguments.tracker.empty()},
                                      {"--encoder", !arguments.encoder.empty()}});
}

/// Reads --tracker-centre-mm.
Result<void> read_tracker_centres(IdentifyOtfArguments& arguments) {
  for (const auto& text : arguments.tracker_centres) {
    const auto centre_m = parse_mm("--tracker-centre-mm", text);
    ABBE_TRY(centre_m);
    arguments.tracker_centres_m.push_back(*centre_m);
  }
  const std::size_t files = std::max<std::size_t>(1, arguments.targets.size());
  if (arguments.tracker_centres_m.size() <= 1 || arguments.tracker_centres_m.size() == files)
    return {};
  return fail(
      ErrorCode::Usage,
      fmt::format(
          "--tracker-centre-mm is given {} times, --target-mm {} times: give the centre once, "
          "or once for each --target-mm",
          arguments.tracker_centres_m.size(), arguments.targets.size()));
}

Result<OtfOutcome> from_files(const IdentifyOtfArguments& arguments,
                              const std::optional<ActiveDocument>& active,
                              const Progress& progress) {
  auto run = identify_files(arguments, active, progress);
  ABBE_TRY(run);
  return outcome_of({std::move(run->found.solution), std::move(run->verdict), run->mode,
                     std::move(run->residuals)},
                    run->config, std::move(run->sources));
}

}  // namespace

Result<OtfOutcome> identify_otf_from(IdentifyOtfArguments arguments, const Progress& progress) {
  ABBE_TRY(check_words(arguments));
  ABBE_TRY(check_sources(arguments));
  ABBE_TRY(read_tracker_centres(arguments));
  const auto active = active_model(arguments.keep);
  ABBE_TRY(active);
  if (!arguments.targets.empty()) return from_targets(arguments, *active, progress);
  return arguments.recording.empty() ? from_files(arguments, *active, progress)
                                     : from_recording(arguments, *active, progress);
}

}  // namespace abbe::daemon
