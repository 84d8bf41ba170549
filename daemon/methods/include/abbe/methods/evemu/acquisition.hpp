#pragma once
/// Which touches belong to one calibration with a ball array, and what comes next. The places are
/// judged by calib's TouchGuide; here touches become usable or not, with device and reason, and
/// nothing arriving any more ends the run. Decided from snapshots alone, so that a replay takes the
/// very same touches; only tick() knows a clock. Ordinary world; not thread-safe; m, scale
/// readings.

#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/base/input_file.hpp"
#include "abbe/calib/axis_table.hpp"
#include "abbe/calib/evemu/touch_guide.hpp"
#include "abbe/methods/evemu/artefact_thermometer.hpp"
#include "abbe/pipeline/acquisition_phase.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::daemon {

/// V known independently at some readings, for the rotation no touch of the array can see.
struct RotationPoints {
  std::vector<calib::evemu::BallError> points;
  double sigma_m = 1e-6;  ///< standard uncertainty of V, per component
};

/// What a calibration with a ball array is asked for.
struct EvemuRequest {
  calib::evemu::Calibrator calibrator;
  calib::evemu::TouchPlan plan;
  std::optional<RotationPoints> reference;
  std::vector<InputFile> sources;  ///< the files all this came from
};

struct EvemuRun {
  EvemuRequest asked;
  std::vector<calib::evemu::Touch> touches;
  std::optional<calib::evemu::ArtefactTemperature>
      artefact;  ///< over the touches; none: nobody knows
};

struct EvemuAcquisitionOptions {
  std::string device = "probe";  ///< its name, for what is said about touches
  /// A counter card that begins anew counts from where the axes stand; with [reference] the zero is
  /// found again.
  bool zero_is_lost_by_restart = true;
  /// Host time without a touch that ends the run: the artefact is turned and clamped by hand in
  /// between.
  std::chrono::nanoseconds longest_pause = std::chrono::hours{1};
  /// Touches more than 1 mm outside are not used; thermal correction moves readings by less. None:
  /// no limit.
  std::optional<calib::MachineNodes> travel{};
  std::size_t most_refused =
      20;  ///< touches in a row that cannot be used end a run that has none yet
  /// How warm the array is. A touch at which its sensor has no valid value ends the run: the model
  /// would need it.
  std::optional<ArtefactTemperatureConfig> artefact{};
  std::string artefact_sensor{};  ///< its name
};

class EvemuAcquisition {
 public:
  using Phase = AcquisitionPhase;

  /// BadInput for a calibrator or plan that is none.
  [[nodiscard]] static Result<EvemuAcquisition> create(EvemuRequest request,
                                                       EvemuAcquisitionOptions options = {});

  /// Before the first snapshot. Touches before `from` do not count.
  void begin(protocol::HostTime from) noexcept { from_ = last_touch_ = from; }

  void take(const protocol::Snapshot& snapshot);
  void tick(protocol::HostTime now);

  [[nodiscard]] Phase phase() const noexcept { return phase_; }
  [[nodiscard]] const std::string& reason() const noexcept {
    return reason_;
  }                                                ///< what to do now, or why not
  [[nodiscard]] double progress() const noexcept;  ///< 0 to 1 of the points
  [[nodiscard]] std::size_t points() const { return guide_.taken(); }
  /// Nothing once the last point is there.
  [[nodiscard]] std::optional<calib::evemu::NextTouch> next() const;
  /// What was noticed since the last call, a sentence each.
  [[nodiscard]] std::vector<std::string> take_notes();
  [[nodiscard]] EvemuRun release();

 private:
  EvemuAcquisition(EvemuRequest request, calib::evemu::TouchGuide guide,
                   EvemuAcquisitionOptions options);
  void refuse(const protocol::Snapshot& touch, std::string_view fault);
  void note(const protocol::Snapshot& touch, const std::string& what);
  void report_next_step();

  EvemuRequest request_;
  calib::evemu::TouchGuide guide_;
  ArtefactThermometer thermometer_;
  protocol::HostTime from_{};
  EvemuAcquisitionOptions options_;
  Phase phase_ = Phase::WaitingAtStart;
  std::string reason_;
  std::vector<std::string> notes_;
  protocol::HostTime last_touch_{};
  std::size_t refused_in_a_row_ = 0;
};

}  // namespace abbe::daemon
