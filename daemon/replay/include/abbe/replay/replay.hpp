#pragma once
/// A recording goes once more through the same receivers, assembler, session and identification as
/// it did live. From the decoded samples or from the raw device bytes, at recorded speed or as fast
/// as possible; the model's hash comes out the same. Reads no clock but to pace itself.

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "abbe/config/config.hpp"
#include "abbe/methods/calibration_run.hpp"
#include "abbe/methods/calibration_session.hpp"
#include "abbe/pipeline/batch.hpp"
#include "abbe/pipeline/session_status.hpp"
#include "abbe/recording/recording_reader.hpp"

namespace abbe::daemon {

enum class ReplaySource { Samples, RawBytes };

struct ReplayOptions {
  ReplaySource source = ReplaySource::Samples;
  double speed = 0.0;  ///< recorded seconds per second; 0: as fast as possible
  /// what the gate compares with; null: no compensation alone
  const calib::VolumetricModel* active = nullptr;
  std::function<void(double share)> progress;
  /// Sees every turn as the assembler gets it, with the time at which the recording's first message
  /// was taken.
  std::function<void(const Batch& batch, protocol::HostTime begin)> samples;
  /// Sees every snapshot, in order.
  std::function<void(const protocol::Snapshot&)> snapshots;
  /// Gets every complete run instead of its being identified again.
  std::function<void(CalibrationRun)> runs;
};

/// One calibration of the recording, done again.
struct ReplayedCalibration {
  SessionStatus ended;  ///< state Identifying: the run was complete; else why it was not
  std::optional<Result<Candidate>>
      outcome;             ///< of a complete run; none if ReplayOptions::runs got it
  std::string model_hash;  ///< empty without a model
  std::string model_id;
  std::string points_sha256;  ///< of the points or touches that entered the identification
};

/// The datum of one axis, found once more from the marks in the raw bytes of both cards.
struct ReplayedDatum {
  std::string axis;
  double live = 0.0;  ///< m or rad: the reading at count 0, as the recording's own attachment says
  std::optional<double> again;  ///< nothing: the marks in the recording do not give it
};

struct ReplayReport {
  std::vector<ReplayedCalibration> calibrations;
  std::vector<ReplayedDatum> datums;        ///< from raw bytes only
  std::vector<std::string> live_model_ids;  ///< as the recording's own events name them
  std::uint64_t snapshots = 0;
  std::uint64_t undecodable = 0;
  std::chrono::nanoseconds recorded{};  ///< from the first to the last message
};

/// The rule: a claim may never be surer than the data. What is damaged inside a recording is
/// missing in what is identified from it, so the gate refuses such a model, by name; a recorded
/// configuration without a checksum is a note.
void judge_recording(const RecordingReader& recording, calib::Verdict& verdict);

/// The recorded configuration. BadInput if its checksum is wrong, or what parse_config() says.
[[nodiscard]] Result<Config> recorded_config(const RecordingReader& recording,
                                             const std::string& file);

/// `config` is the one the recording was made with (RecordingInfo::configuration). BadInput for a
/// recording whose calibration request cannot be read. The verdicts have gone through
/// judge_recording().
[[nodiscard]] Result<ReplayReport> replay(const RecordingReader& recording, const Config& config,
                                          const ReplayOptions& options);

}  // namespace abbe::daemon
