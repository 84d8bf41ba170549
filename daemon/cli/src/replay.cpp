/// `abbe replay FILE`: repeats a recorded run: the recording passes through receivers, assembler,
/// session and identification like the live data.

#include <fmt/format.h>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <algorithm>
#include <chrono>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "abbe/base/exit_codes.hpp"
#include "abbe/base/json_text.hpp"
#include "abbe/base/printable.hpp"
#include "abbe/replay/replay.hpp"
#include "commands.hpp"
#include "sample_lines.hpp"
#include "terminal.hpp"

namespace abbe::daemon {
namespace {

using nlohmann::json;

struct ReplayArguments {
  std::string file;
  std::string config;
  bool raw = false;
  double speed = 0.0;
  bool json = false;
  bool samples = false;
};

Result<Config> config_of(const ReplayArguments& arguments, const RecordingReader& recording) {
  if (!arguments.config.empty()) return load_config(arguments.config);
  return recorded_config(recording, arguments.file);
}

json calibration_json(const ReplayedCalibration& c) {
  json out{{"state", name(c.ended.state)}, {"reason", c.ended.reason}};
  if (!c.outcome) return out;
  if (!*c.outcome) {
    out["error"] = c.outcome->error().text;
    return out;
  }

  const auto& verdict = verdict_of(**c.outcome);
  out["model_hash"] = c.model_hash;
  out["model_id"] = c.model_id;
  out["accepted"] = verdict.accepted;
  out["reasons"] = verdict.reasons;
  out["notes"] = verdict.notes;
  out["points_sha256"] = c.points_sha256;

  return out;
}

bool same_as_live(const ReplayReport& report) {
  std::vector<std::string> ids;
  for (const auto& c : report.calibrations) {
    if (!c.model_id.empty()) ids.push_back(c.model_id);
  }
  return ids == report.live_model_ids;
}

void print_report(const RecordingReader& recording, const ReplayReport& r, double wall_s) {
  const double recorded_s = std::chrono::duration<double>(r.recorded).count();
  fmt::print("{} snapshots, {:.1f} s recorded, replayed in {:.2f} s: {:.0f} x real time\n",
             r.snapshots, recorded_s, wall_s, recorded_s / wall_s);

  if (r.snapshots == 0)
    fmt::print("nothing      no snapshot in {} messages and {} samples: --samples prints them\n",
               recording.message_count(), r.samples);

  for (const auto& c : r.calibrations) {
    if (!c.outcome) {
      fmt::print("calibration  {}: {}\n", name(c.ended.state), printable_line(c.ended.reason));
    } else if (!*c.outcome) {
      fmt::print("calibration  not identified: {}\n", c.outcome->error().text);
    } else {
      fmt::print("calibration  {} model {}\n             hash {}\n",
                 verdict_of(**c.outcome).accepted ? "accepted" : "refused", c.model_id,
                 c.model_hash);
    }
  }

  for (const auto& d : r.datums) {
    fmt::print("reference    {}: count 0 is at {:.6f} mm live, {} from the marks in the bytes\n",
               d.axis, 1e3 * d.live,
               d.again ? fmt::format("{:.6f} mm", 1e3 * *d.again) : "not found");
  }

  if (const auto damage = recording.damage(); !damage.empty())
    fmt::print("DAMAGED      {}\n", damage);
  if (r.undecodable > 0) fmt::print("DAMAGED      {} messages cannot be decoded\n", r.undecodable);
  if (recording.configuration_check() == MetadataCheck::Unchecked)
    fmt::print("unchecked    the recorded configuration has no checksum: damage is not detected\n");
  for (const auto& id : r.live_model_ids) fmt::print("live         model {}\n", id);
  if (!r.live_model_ids.empty())
    fmt::print("{}\n", same_as_live(r) ? "the same as live" : "NOT the same as live");
}

void print_json(const RecordingReader& recording, const ReplayReport& r, double wall_s) {
  json out{{"snapshots", r.snapshots},
           {"samples", r.samples},
           {"undecodable", r.undecodable},
           {"recorded_s", std::chrono::duration<double>(r.recorded).count()},
           {"wall_s", wall_s},
           {"live_model_ids", r.live_model_ids},
           {"same_as_live", same_as_live(r)},
           {"damage", recording.damage()},
           {"configuration_checked", recording.configuration_check() == MetadataCheck::Right},
           {"reference", json::array()},
           {"losses", json::array()},
           {"calibrations", json::array()}};
  for (const auto& loss : recording.losses()) out["losses"].push_back(loss.what);

  for (const auto& d : r.datums)
    out["reference"].push_back(
        {{"axis", d.axis}, {"live", d.live}, {"again", d.again ? json(*d.again) : json{}}});
  for (const auto& c : r.calibrations) out["calibrations"].push_back(calibration_json(c));
  fmt::print("{}\n", indented_json_text(out));
}

/// Exit code of the replay. A model that differs from the live one is an error, unless another
/// configuration was given (-c). So is a replay that gives nothing.
int exit_code_of(const RecordingReader& recording, const ReplayReport& report,
                 const ReplayArguments& arguments) {
  constexpr int kDone = number(ExitCode::Done), kNoAnswer = number(ExitCode::DataInsufficient);
  const bool all_identified = std::all_of(report.calibrations.begin(), report.calibrations.end(),
                                          [](const auto& c) { return c.outcome && *c.outcome; });
  const bool any = (arguments.samples ? report.samples : report.snapshots) > 0;
  const bool sound = any && recording.damage().empty() && report.undecodable == 0;
  const bool must_agree = !report.live_model_ids.empty() && arguments.config.empty();
  return sound && all_identified && (!must_agree || same_as_live(report)) ? kDone : kNoAnswer;
}

int run(const ReplayArguments& arguments) {
  const auto start = std::chrono::steady_clock::now();
  const auto recording = RecordingReader::open(arguments.file);
  if (!recording) return report(recording.error());
  for (const auto& loss : recording->losses())
    fmt::print(stderr, "{}: {}\n", printable_line(arguments.file), printable_line(loss.what));

  const auto config = config_of(arguments, *recording);
  if (!config) return report(config.error());
  ProgressBar bar;
  ReplayOptions options{.source = arguments.raw ? ReplaySource::RawBytes : ReplaySource::Samples,
                        .speed = arguments.speed,
                        .progress = [&bar](double share) { bar.show("replaying", share); }};

  if (arguments.samples)
    options.samples = [](const Batch& batch, protocol::HostTime begin) {
      print_samples(stdout, batch, begin);
    };

  const auto result = replay(*recording, *config, options);
  bar.clear();
  if (!result) return report(result.error());
  const double wall_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  if (arguments.samples) return exit_code_of(*recording, *result, arguments);

  if (arguments.json) {
    print_json(*recording, *result, wall_s);
  } else {
    print_report(*recording, *result, wall_s);
  }

  return exit_code_of(*recording, *result, arguments);
}

}  // namespace

void add_replay(CLI::App& parent, int& exit) {
  auto arguments = std::make_shared<ReplayArguments>();
  auto* command = parent.add_subcommand(
      "replay",
      "Replay a recording: the same snapshots and the same model as live.\n"
      "Exit code 1 if there is no snapshot (with --samples: no sample), if a calibration gives no\n"
      "model, or (without -c) another model than live, or if the recording is damaged before its\n"
      "end; 3 if the recorded configuration is damaged and -c is not given; 4 if the file becomes\n"
      "shorter while it is read.");
  command->add_option("FILE", arguments->file, "recording (.mcap, also an unfinished .mcap.part)")
      ->required();
  command->add_flag("--raw", arguments->raw,
                    "replay the raw device bytes instead of the decoded samples");
  command
      ->add_option("--speed", arguments->speed,
                   "recorded time per real time; 0: as fast as possible")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
  command->add_option("-c,--config", arguments->config,
                      "use this configuration instead of the recorded one");
  auto* as_json = command->add_flag("--json", arguments->json, "print one JSON object");
  command
      ->add_flag("--samples", arguments->samples, "print one line per sample instead of the report")
      ->excludes(as_json);
  command->callback([arguments, &exit] { exit = run(*arguments); });
}

}  // namespace abbe::daemon
