#include "abbe/tasks/replay_recording.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "abbe/result/try.hpp"

namespace abbe::daemon {
namespace {

using nlohmann::json;

Result<Config> config_of_replay(const ReplayArguments& arguments,
                                const RecordingReader& recording) {
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

}  // namespace

Result<ReplayedRecording> replay_recording(const ReplayArguments& arguments,
                                           const ShowLoss& show_loss, const Progress& progress) {
  const auto start = std::chrono::steady_clock::now();
  const auto stopped = [&progress] { return progress.stopped(); };
  auto recording = RecordingReader::open(arguments.file, stopped);
  ABBE_TRY(recording);
  if (show_loss) std::ranges::for_each(recording->losses(), show_loss);

  const auto config = config_of_replay(arguments, *recording);
  ABBE_TRY(config);
  auto report =
      replay(*recording, *config,
             {.source = arguments.raw ? ReplaySource::RawBytes : ReplaySource::Samples,
              .speed = arguments.speed,
              .progress = [&progress](double share) { progress.show("replaying", share); },
              .stopped = stopped,
              .samples = arguments.samples});
  ABBE_TRY(report);
  return ReplayedRecording{std::move(*recording), std::move(*report),
                           std::chrono::steady_clock::now() - start};
}

bool same_as_live(const ReplayReport& report) {
  std::vector<std::string> ids;
  for (const auto& c : report.calibrations) {
    if (!c.model_id.empty()) ids.push_back(c.model_id);
  }
  return ids == report.live_model_ids;
}

bool is_confirmed(const ReplayedRecording& replayed, const ReplayArguments& arguments) {
  const ReplayReport& report = replayed.report;
  const bool all_identified = std::all_of(report.calibrations.begin(), report.calibrations.end(),
                                          [](const auto& c) { return c.outcome && *c.outcome; });
  const bool any = (arguments.samples ? report.samples : report.snapshots) > 0;
  const bool sound = any && replayed.recording.damage().empty() && report.undecodable == 0;
  const bool must_agree = !report.live_model_ids.empty() && arguments.config.empty();
  return sound && all_identified && (!must_agree || same_as_live(report));
}

json replay_json(const ReplayedRecording& replayed) {
  const RecordingReader& recording = replayed.recording;
  const ReplayReport& r = replayed.report;
  json out{{"snapshots", r.snapshots},
           {"samples", r.samples},
           {"undecodable", r.undecodable},
           {"recorded_s", std::chrono::duration<double>(r.recorded).count()},
           {"wall_s", replayed.wall.count()},
           {"live_model_ids", r.live_model_ids},
           {"same_as_live", same_as_live(r)},
           {"damage", recording.damage()},
           {"configuration_checked", recording.configuration_check() == MetadataCheck::Right},
           {"reference", json::array()},
           {"losses", json::array()},
           {"calibrations", json::array()}};
  for (const auto& loss : recording.losses()) out["losses"].push_back(loss.what);

  for (const auto& d : r.zeros)
    out["reference"].push_back(
        {{"axis", d.axis}, {"live", d.live}, {"again", d.again ? json(*d.again) : json{}}});
  for (const auto& c : r.calibrations) out["calibrations"].push_back(calibration_json(c));
  return out;
}

}  // namespace abbe::daemon
