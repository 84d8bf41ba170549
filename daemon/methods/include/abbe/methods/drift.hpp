#pragma once
/// What a new run says about the active model: a test for drift, and for continuous calibration the
/// update of the active model with the run. For every method whose models are tables. Pure
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
  std::vector<std::string> notes{};        ///< for the verdict: what changed, or why not tested
  /// For the state of the active model; empty: no drift.
  [[nodiscard]] std::string state() const;
};

/// `active`: the model with which the gate compared the run. Not tested if the configuration
/// switches it off, if `run` is no model of tables, or if the verdict refuses the run for another
/// reason than the comparison with the active model (calib::shows_machine).
[[nodiscard]] DriftFinding find_drift(const calib::VolumetricModel& run,
                                      const calib::Verdict& verdict,
                                      const calib::VolumetricModel& active,
                                      const DriftConfig& config);

/// Process noise for `days` since the active model, tables that drifted, and what the run has in
/// common with all others: the scale of the ranges and of the axes.
[[nodiscard]] calib::UpdateOptions update_options(const CalibrationRun& run,
                                                  const DriftFinding& finding, double days,
                                                  const DriftConfig& config);

/// The offset of the ranges that `active`, made `days` ago, has in common with a run from the place
/// `run`: of the same name, and not older than [drift] place_days.
struct OffsetInCommon {
  std::optional<calib::OffsetInModel> of_active{};
  std::string note{};  ///< for the verdict: why it is not used; empty: it is, or there is none
};
[[nodiscard]] OffsetInCommon offset_in_common(const std::optional<calib::TrackerPlace>& run,
                                              const std::optional<calib::TrackerPlace>& active,
                                              double days, const DriftConfig& config);

struct UpdatedModel {
  calib::ModelWithOffset model;
  calib::Verdict verdict;  ///< held-out figures and notes of the run
};

/// The active model updated with a run that find_drift() tested. Its verdict has the rules of the
/// gate for size, slope, volume and scale; that it is better than the active model follows from the
/// run itself, which agrees with it in all tables that are kept. Refused if tables that drifted do
/// not explain the difference of both, else as calib::update_model().
[[nodiscard]] Result<UpdatedModel> updated_model(const calib::ModelWithOffset& run,
                                                 const calib::Verdict& verdict,
                                                 const calib::ModelWithOffset& active,
                                                 const calib::DriftTest& test,
                                                 const calib::UpdateOptions& options,
                                                 const GateConfig& gate);

}  // namespace abbe::daemon
