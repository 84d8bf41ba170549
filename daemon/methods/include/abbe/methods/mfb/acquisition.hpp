#pragma once
/// Collects the touches of one calibration with a Multi-Feature Bar, and states which feature must
/// be touched next. calib's TouchGuide assigns touches to their places. This class rejects unusable
/// touches, with device and reason, and ends the run when touches stop arriving. The decisions
/// depend on snapshots only, so that a replay uses exactly the same touches; only tick() receives
/// the time. Not for the RT path; not thread-safe. Positions are scale readings in m.

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/base/input_file.hpp"
#include "abbe/calib/mfb/live/touch_guide.hpp"
#include "abbe/config/config.hpp"
#include "abbe/methods/touch_intake.hpp"
#include "abbe/pipeline/acquisition_phase.hpp"
#include "abbe/pipeline/session_status.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::daemon {

/// Request for a calibration with a bar. It contains the text of the files, so that a replay reads
/// the same text.
struct MfbRequest {
  struct File {
    std::string name;
    std::string text;
  };
  File bar, plan;  ///< bar.toml, plan.toml
  /// Readings of the touches of earlier sessions, in the order in which they were taken. The
  /// session continues after the last one.
  std::vector<calib::Vector3> earlier_m;
};

struct MfbRun {
  calib::mfb::Bar bar;
  calib::mfb::Plan plan;
  std::vector<calib::mfb::PassTouches> passes;  ///< one per measurement of the plan
  std::vector<InputFile> sources;
  /// Host times of the first and the last touch. nullopt: not known, because touches of earlier
  /// sessions have no times.
  std::optional<std::array<protocol::HostTime, 2>> observed{};
};

struct MfbAcquisitionOptions {
  TouchRules touches{};
  /// Temperature sensor on the bar. A touch is not used if the sensor has no valid value at its
  /// instant. nullopt: plan.toml states the temperatures.
  std::optional<ArtefactTemperatureConfig> bar{};
  std::string bar_sensor{};  ///< name of the temperature sensor
  /// Machine model of the configuration. An Error if it is not a machine that can be calibrated
  /// with a bar.
  Result<calib::mfb::MfbMachine> machine = fail(ErrorCode::Refused, "no machine is configured");
};

class MfbAcquisition {
 public:
  using Phase = AcquisitionPhase;

  /// Creates the acquisition and takes the earlier touches. BadInput, with file, line and key, for
  /// an invalid bar or plan. BadInput also for a bar position outside the travel, and for earlier
  /// touches that belong to another bar.
  [[nodiscard]] static Result<MfbAcquisition> create(const MfbRequest& request,
                                                     MfbAcquisitionOptions options);

  /// Call it before the first take(). Touches before `from` are ignored.
  void begin(protocol::HostTime from) noexcept { intake_.begin(from); }

  void take(const protocol::Snapshot& snapshot);
  void tick(protocol::HostTime now);

  [[nodiscard]] Phase phase() const noexcept { return phase_; }
  /// Instruction for the operator, or the reason of the failure.
  [[nodiscard]] const std::string& reason() const noexcept { return reason_; }
  [[nodiscard]] double progress() const;  ///< fraction of the planned touches, 0 to 1
  [[nodiscard]] std::size_t points() const { return guide_.taken(); }
  /// The next touch that the operator must make; nullopt once the run is complete or failed.
  [[nodiscard]] std::optional<RequestedTouch> next() const;
  /// Remarks on touches since the last call, one sentence each.
  [[nodiscard]] std::vector<std::string> take_notes() { return intake_.take_notes(); }
  /// Readings of all touches so far, in the order in which they were taken.
  [[nodiscard]] std::vector<calib::Vector3> readings_m() const;
  /// Ends the acquisition and returns the run. With a sensor on the bar, the plan of the run
  /// contains the measured mean temperature of each pass and its uncertainty, instead of the stated
  /// temperature. A pass that was touched only in earlier sessions keeps the stated temperature;
  /// the uncertainty common to all passes is then the larger of the two.
  [[nodiscard]] MfbRun release();

 private:
  MfbAcquisition(calib::mfb::Bar bar, std::vector<InputFile> sources, calib::mfb::TouchGuide guide,
                 MfbAcquisitionOptions options);
  /// The temperature of the bar at a touch. nullopt: the sensor has no valid value. Without a
  /// sensor the result is 0.
  [[nodiscard]] std::optional<double> temperature_at(const protocol::Snapshot& touch) const;
  calib::mfb::GuidedTouch take_at(const calib::Vector3& reading_m, double temperature_K);
  [[nodiscard]] calib::mfb::Plan plan_as_measured() const;
  void refuse(const protocol::Snapshot& touch, std::string_view fault);
  void end(std::string reason);
  void follow_guide();

  calib::mfb::Bar bar_;
  std::vector<InputFile> sources_;
  calib::mfb::TouchGuide guide_;
  /// Temperatures of the bar at the touches of each pass, without those of earlier sessions.
  std::vector<std::vector<double>> temperature_K_;
  MfbAcquisitionOptions options_;
  TouchIntake intake_;
  bool has_earlier_ = false;  // the run contains touches of earlier sessions
  Phase phase_ = Phase::WaitingAtStart;
  std::string reason_;
};

}  // namespace abbe::daemon
