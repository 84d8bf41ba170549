#pragma once
/// Identifies a model from touches of a ball array and judges it. A live session, its replay,
/// `abbe identify evemu` and `abbe identify joint` use the same function. Pure and
/// deterministic. It takes a tenth of a second with the default estimator, seconds with lasso, mcp
/// or scad; the daemon runs it in a separate thread.

#include <optional>
#include <string>
#include <string_view>

#include "abbe/base/error.hpp"
#include "abbe/calib/evemu/judge/judge.hpp"
#include "abbe/config/config.hpp"
#include "abbe/methods/evemu/acquisition.hpp"

namespace abbe::daemon {

struct EvemuCandidate {
  calib::evemu::Observations observations;
  calib::evemu::Solution solution;
  calib::Verdict verdict;
};

/// Input of an identification from touches of an array. The touches are live, replayed or from
/// files.
struct EvemuTask {
  calib::evemu::Observations observations;
  calib::evemu::JudgeOptions judging;
  std::optional<RotationPoints> rotation_reference{};  ///< points where V is known
};
/// The observations of an acquired run. If `order` or `positions` has no value, the order of
/// [evemu] and the positions of the request are used.
[[nodiscard]] Result<calib::evemu::Observations> evemu_observations(
    const EvemuRun& run, const Config& config, std::optional<int> order = {},
    std::optional<int> positions = {});

/// The options of the judgement from [evemu] and [gate].
[[nodiscard]] calib::evemu::JudgeOptions evemu_judge_options(const Config& config);

/// Identifies a model and judges it. `active`: the active model, with which the gate compares; null
/// if there is none. An Error DataInsufficient or BadInput names the position and number of the
/// touches that caused it. A model whose rotation about Ball1 is not known is refused as "shape
/// only" unless [gate] accepts "evemu-shape-only".
[[nodiscard]] Result<EvemuCandidate> identify_with_array(EvemuTask task,
                                                         const calib::VolumetricModel* active);

[[nodiscard]] calib::evemu::TouchPlan touch_plan(const EvemuConfig& config);
/// Refused or BadInput if the request cannot give a model: no source of touches is configured, the
/// measuring machine already corrects its positions, or only one of temperature and expansion
/// coefficient of the array is known.
[[nodiscard]] Result<void> check_evemu(const EvemuRequest& request, const Config& config);
/// Checks that the expansion coefficient and the temperature of the array are given both or not at
/// all. Returns a message, empty if the check passed. The other arguments are parts of the message.
/// `named`: name of the calibrator. `thermometer`: source of the temperature; empty: there is none.
/// `remedy`: how the user can give the temperature.
[[nodiscard]] std::string artefact_temperature_fault(const calib::evemu::Calibrator& calibrator,
                                                     std::string_view named,
                                                     std::string_view thermometer,
                                                     std::string_view remedy);
[[nodiscard]] EvemuAcquisitionOptions evemu_acquisition_options(const Config& config);

}  // namespace abbe::daemon
