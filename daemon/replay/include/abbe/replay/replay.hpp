#pragma once
/// Replays a recording through the same receivers, assembler, session and identification as in the
/// live run, and gives a model with the same hash as in the live run. The input is either the
/// decoded samples or the raw device bytes; the speed is the recorded speed, a multiple of it, or
/// as fast as possible. The clock is read only to keep that speed.

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
  /// Model with which the gate compares the new one. null: the gate compares the new model only
  /// with no compensation.
  const calib::VolumetricModel* active = nullptr;
  std::function<void(double share)> progress;
  /// Called often, on the thread of the replay. If it returns true, the replay soon returns an
  /// Error; from then on it must always return true.
  std::function<bool()> stopped;
  /// Called for every cycle with the batch that the assembler gets, and with the time at which the
  /// first message of the recording was taken.
  std::function<void(const Batch& batch, protocol::HostTime begin)> samples;
  /// Called for every snapshot, in order.
  std::function<void(const protocol::Snapshot&)> snapshots;
  /// Called for every calibration event of the live run.
  std::function<void(const v1::CalibrationEvent&)> events;
  /// Called with every complete run; if set, replay() itself identifies no run.
  std::function<void(CalibrationRun)> runs;
};

/// One calibration of the recording, replayed.
struct ReplayedCalibration {
  /// State Identifying: the run was complete. State Refused: the run was not complete; the status
  /// gives the reason, for example that the recording ends too early.
  SessionStatus ended;
  std::optional<Result<Candidate>>
      outcome;  ///< result for a complete run; nullopt if the run was passed to ReplayOptions::runs
  std::string model_hash;  ///< empty without a model
  std::string model_id;
  std::string points_sha256;  ///< hash of the points or touches that the identification used
  ObservedTimes observed{};   ///< host times of the recording
};

/// The zero of one axis: the zero found live, and the zero that the replay found from the reference
/// marks in the raw bytes of both cards.
struct ReplayedZero {
  std::string axis;
  double live = 0.0;  ///< reading at count 0, m or rad, from the attachment of the recording
  /// the zero that the replay found; nullopt: not found from the recorded marks
  std::optional<double> again;
};

struct ReplayReport {
  std::vector<ReplayedCalibration> calibrations;
  std::vector<ReplayedZero> zeros;          ///< filled only in a replay from raw bytes
  std::vector<std::string> live_model_ids;  ///< ids from the calibration events in the recording
  std::uint64_t snapshots = 0;
  std::uint64_t samples = 0;  ///< number of samples of all devices, recorded or decoded from bytes
  std::uint64_t undecodable = 0;        ///< messages that could not be decoded
  std::chrono::nanoseconds recorded{};  ///< time from the first to the last message
};

/// Adds the damage of `recording` to the verdict on a model that was identified from it. Data of a
/// damaged part are missing in the identification, so a damaged recording makes the verdict a
/// refusal with the reason "damage". A recorded configuration without a checksum adds a note only.
void judge_recording(const RecordingReader& recording, calib::Verdict& verdict);

/// The recorded configuration. BadInput if its checksum is wrong; else the errors of
/// parse_recorded_config().
[[nodiscard]] Result<Config> recorded_config(const RecordingReader& recording,
                                             const std::string& file);

/// Replays the recording. `config` is the configuration of the live run
/// (RecordingInfo::configuration). BadInput if an attachment that the replay needs cannot be read:
/// a calibration request, a search for reference marks, or a zero. DataInsufficient if
/// ReplayOptions::stopped ended it. judge_recording() is already applied to the verdicts in the
/// result.
[[nodiscard]] Result<ReplayReport> replay(const RecordingReader& recording, const Config& config,
                                          const ReplayOptions& options);

}  // namespace abbe::daemon
