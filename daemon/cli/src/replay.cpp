/// `abbe replay FILE`: repeats a recorded run: the recording passes through receivers, assembler,
/// session and identification like the live data.

#include <fmt/format.h>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <chrono>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "abbe/base/exit_codes.hpp"
#include "abbe/base/json_text.hpp"
#include "abbe/base/printable.hpp"
#include "abbe/recording/recording_reader.hpp"
#include "abbe/replay/replay.hpp"
#include "abbe/tasks/replay_recording.hpp"
#include "commands.hpp"
#include "sample_lines.hpp"
#include "terminal.hpp"

namespace abbe::daemon {
namespace {

struct ReplayCommand {
  ReplayArguments replay;
  bool json = false;
  bool samples = false;
};

void print_report(const ReplayedRecording& replayed) {
  const RecordingReader& recording = replayed.recording;
  const ReplayReport& r = replayed.report;
  const double wall_s = replayed.wall.count();
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

  for (const auto& d : r.zeros) {
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

void print_loss(const std::string& file, const RecordingLoss& loss) {
  fmt::print(stderr, "{}: {}\n", printable_line(file), printable_line(loss.what));
}

int run(const ReplayCommand& command) {
  const ReplayArguments& arguments = command.replay;
  ProgressBar bar;
  const auto replayed = replay_recording(
      arguments, [&](const RecordingLoss& loss) { print_loss(arguments.file, loss); },
      bar.progress());
  bar.clear();
  if (!replayed) return report(replayed.error());

  if (command.json) {
    fmt::print("{}\n", indented_json_text(replay_json(*replayed)));
  } else if (!command.samples) {
    print_report(*replayed);
  }

  return number(is_confirmed(*replayed, arguments) ? ExitCode::Done : ExitCode::DataInsufficient);
}

}  // namespace

void add_replay(CLI::App& parent, int& exit) {
  auto options = std::make_shared<ReplayCommand>();
  auto* command = parent.add_subcommand(
      "replay",
      "Replay a recording: the same snapshots and the same model as live.\n"
      "Exit code 1 if there is no snapshot (with --samples: no sample), if a calibration gives no\n"
      "model, or (without -c) another model than live, or if the recording is damaged before its\n"
      "end; 3 if the recorded configuration is damaged and -c is not given; 4 if the file becomes\n"
      "shorter while it is read.");
  command
      ->add_option("FILE", options->replay.file, "recording (.mcap, also an unfinished .mcap.part)")
      ->required();
  command->add_flag("--raw", options->replay.raw,
                    "replay the raw device bytes instead of the decoded samples");
  command
      ->add_option("--speed", options->replay.speed,
                   "recorded time per real time; 0: as fast as possible")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
  command->add_option("-c,--config", options->replay.config,
                      "use this configuration instead of the recorded one");
  auto* as_json = command->add_flag("--json", options->json, "print one JSON object");
  command
      ->add_flag("--samples", options->samples, "print one line per sample instead of the report")
      ->excludes(as_json);
  command->callback([options, &exit] {
    if (options->samples)
      options->replay.samples = [](const Batch& batch, protocol::HostTime begin) {
        print_samples(stdout, batch, begin);
      };
    exit = run(*options);
  });
}

}  // namespace abbe::daemon
