#pragma once
/// Replays a recording and compares the result with that of the live run.

#include <chrono>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "abbe/base/error.hpp"
#include "abbe/pipeline/batch.hpp"
#include "abbe/recording/recording_reader.hpp"
#include "abbe/replay/replay.hpp"
#include "abbe/tasks/progress.hpp"

namespace abbe::daemon {

struct ReplayArguments {
  std::string file;
  /// configuration file used instead of the recorded configuration; empty: the recorded one
  std::string config;
  bool raw = false;    ///< true: replay the raw bytes of the devices instead of the decoded samples
  double speed = 0.0;  ///< recorded time per real time; 0: as fast as possible
  /// ReplayOptions::samples; if set, only the samples are wanted, not the models
  std::function<void(const Batch& batch, protocol::HostTime begin)> samples = {};
};

struct ReplayedRecording {
  RecordingReader recording;
  ReplayReport report;
  std::chrono::duration<double> wall{};  ///< real time for reading the file and replaying it
};

/// Is called for each part of the file that is missing or damaged, before the replay begins. May be
/// empty.
using ShowLoss = std::function<void(const RecordingLoss&)>;

/// Writes no file. Io or BadInput if the file or its configuration cannot be read, or the file
/// becomes shorter while it is read. DataInsufficient if progress.stopped() ended the replay.
[[nodiscard]] Result<ReplayedRecording> replay_recording(const ReplayArguments& arguments,
                                                         const ShowLoss& show_loss,
                                                         const Progress& progress);

/// True if the replay gave the models that the live run reported, in the same order.
[[nodiscard]] bool same_as_live(const ReplayReport& report);

/// False if the replay gave nothing, if a calibration gave no model, if the recording is damaged,
/// or, with the recorded configuration, if the model differs from that of the live run.
[[nodiscard]] bool is_confirmed(const ReplayedRecording&, const ReplayArguments&);

/// One JSON object, as `abbe replay --json` prints it.
[[nodiscard]] nlohmann::json replay_json(const ReplayedRecording&);

}  // namespace abbe::daemon
