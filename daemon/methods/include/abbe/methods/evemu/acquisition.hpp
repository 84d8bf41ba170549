#pragma once
/// Collects the touches of one calibration with a ball array, and states which ball or block must
/// be touched next. calib's TouchGuide assigns touches to balls and blocks. This class rejects
/// unusable touches, with device and reason, and ends the run when touches stop arriving. The
/// decisions depend on snapshots only, so that a replay uses exactly the same touches; only tick()
/// receives the time. Not for the RT path; not thread-safe. Positions are scale readings in m.

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/base/input_file.hpp"
#include "abbe/calib/evemu/live/touch_guide.hpp"
#include "abbe/calib/geometry/axis_table.hpp"
#include "abbe/methods/evemu/artefact_thermometer.hpp"
#include "abbe/methods/touch_intake.hpp"
#include "abbe/pipeline/acquisition_phase.hpp"
#include "abbe/pipeline/session_status.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::daemon {

/// Points at which the volumetric error V is known from another measurement. They determine the
/// rotation about Ball1, which touches of the array do not determine.
struct RotationPoints {
  std::vector<calib::evemu::BallError> points;
  double sigma_m = 1e-6;  ///< standard uncertainty of V, per component
};

/// Request for a calibration with a ball array.
struct EvemuRequest {
  calib::evemu::Calibrator calibrator;
  calib::evemu::TouchPlan plan;
  std::optional<RotationPoints> rotation_reference;
  std::vector<InputFile> sources;  ///< files from which the request was read
};

struct EvemuRun {
  EvemuRequest asked;
  std::vector<calib::evemu::Touch> touches;
  /// temperature of the array during the touches; nullopt: unknown
  std::optional<calib::evemu::ArtefactTemperature> artefact;
  /// Host times of the first and the last observation; nullopt: not known.
  std::optional<std::array<protocol::HostTime, 2>> observed{};
};

struct EvemuAcquisitionOptions {
  TouchRules touches{};
  /// Travel of the axes. Touches more than 1 mm outside the travel are not used; thermal correction
  /// changes a reading by less. nullopt: no limit.
  std::optional<calib::MachineNodes> travel{};
  /// Source of the temperature of the array. A touch is not used if the sensor has no valid value
  /// at its instant, because the identification needs the temperature.
  std::optional<ArtefactTemperatureConfig> artefact{};
  std::string artefact_sensor{};  ///< name of that temperature sensor
};

class EvemuAcquisition {
 public:
  using Phase = AcquisitionPhase;

  /// Creates the acquisition. BadInput for an invalid calibrator or plan.
  [[nodiscard]] static Result<EvemuAcquisition> create(EvemuRequest request,
                                                       EvemuAcquisitionOptions options = {});

  /// Call it before the first take(). Touches before `from` are ignored.
  void begin(protocol::HostTime from) noexcept { intake_.begin(from); }

  void take(const protocol::Snapshot& snapshot);
  void tick(protocol::HostTime now);

  [[nodiscard]] Phase phase() const noexcept { return phase_; }
  /// Instruction for the operator, or the reason of the failure.
  [[nodiscard]] const std::string& reason() const noexcept { return reason_; }
  [[nodiscard]] double progress() const noexcept;  ///< fraction of the planned points, 0 to 1
  [[nodiscard]] std::size_t points() const { return guide_.taken(); }
  /// The next touch that the operator must make; nullopt once the run is complete or failed.
  [[nodiscard]] std::optional<RequestedTouch> next() const;
  /// Remarks on touches since the last call, one sentence each.
  [[nodiscard]] std::vector<std::string> take_notes() { return intake_.take_notes(); }
  [[nodiscard]] EvemuRun release();

 private:
  EvemuAcquisition(EvemuRequest request, calib::evemu::TouchGuide guide,
                   EvemuAcquisitionOptions options);
  void refuse(const protocol::Snapshot& touch, std::string_view fault);
  void end(std::string reason);
  void follow_guide();

  EvemuRequest request_;
  calib::evemu::TouchGuide guide_;
  ArtefactThermometer thermometer_;
  EvemuAcquisitionOptions options_;
  TouchIntake intake_;
  Phase phase_ = Phase::WaitingAtStart;
  std::string reason_;
  std::shared_ptr<const std::vector<FeatureToTouch>> features_;  ///< rebuilt after each touch
};

}  // namespace abbe::daemon
