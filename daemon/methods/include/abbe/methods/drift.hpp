#pragma once
/// Compares a new run with the active model: a test for drift and, for continuous calibration, the
/// update of the active model with the run. Used by every method whose models are tables. Pure
/// functions.

#include <optional>
#include <string>
#include <vector>

#include "abbe/calib/model/gate.hpp"
#include "abbe/calib/model/model_drift.hpp"
#include "abbe/calib/model/model_update.hpp"
#include "abbe/methods/calibration_run.hpp"

namespace abbe::daemon {

struct DriftFinding {
  std::optional<calib::DriftTest> test{};  ///< nullopt: not tested
  /// for the verdict: the tables that changed, or why the test was not made
  std::vector<std::string> notes{};
  /// Description of the drift for the state of the active model; empty: no drift.
  [[nodiscard]] std::string state() const;
};

/// `active`: the model with which the gate compared the run. The test is not made if the
/// configuration switches it off, if `run` is no model of tables, or if the verdict refuses the run
/// for another reason than the comparison with the active model (see calib::shows_machine).
[[nodiscard]] DriftFinding find_drift(const calib::VolumetricModel& run,
                                      const calib::Verdict& verdict,
                                      const calib::VolumetricModel& active,
                                      const DriftConfig& config);

/// Options of the update: process noise for `days` since the active model, the tables that drifted,
/// and the quantities that the run has in common with all other runs (scale of the ranges and of
/// the axes).
[[nodiscard]] calib::UpdateOptions update_options(const CalibrationRun& run,
                                                  const DriftFinding& finding, double days,
                                                  const DriftConfig& config);

/// The offset of the ranges, if `active`, made `days` ago, has it in common with the run. This is
/// so if both were measured from a tracker place of the same name, and if the place is not older
/// than [drift] place_days.
struct OffsetInCommon {
  std::optional<calib::OffsetInModel> of_active{};
  /// for the verdict: why the common offset is not used; empty: it is used, or there is none
  std::string note{};
};
[[nodiscard]] OffsetInCommon offset_in_common(const std::optional<calib::TrackerPlace>& run,
                                              const std::optional<calib::TrackerPlace>& active,
                                              double days, const DriftConfig& config);

struct UpdatedModel {
  calib::ModelWithOffset model;
  calib::Verdict verdict;  ///< held-out figures and notes of the run
};

/// The active model, updated with a run that find_drift() tested. The gate's rules for size, slope,
/// volume and scale decide on its verdict. It is not compared with the active model: the run itself
/// agrees with the active model in all tables that are kept. Refused if the drifted tables do not
/// explain the difference between run and active model; other errors are those of
/// calib::update_model().
[[nodiscard]] Result<UpdatedModel> updated_model(const calib::ModelWithOffset& run,
                                                 const calib::Verdict& verdict,
                                                 const calib::ModelWithOffset& active,
                                                 const calib::DriftTest& test,
                                                 const calib::UpdateOptions& options,
                                                 const GateConfig& gate);

}  // namespace abbe::daemon
