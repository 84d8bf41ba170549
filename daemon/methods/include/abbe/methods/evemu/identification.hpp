#pragma once
/// Touches of a ball array become a judged model: observe, solve, judge in a row, with the
/// estimator of [evemu], the same for a live session and its replay. Pure and deterministic. A
/// tenth of a second with the default estimator, seconds with lasso, mcp, scad; runs on a thread of
/// its own in the daemon.

#include <functional>
#include <string>
#include <string_view>

#include "abbe/base/error.hpp"
#include "abbe/calib/evemu/judge.hpp"
#include "abbe/config/config.hpp"
#include "abbe/methods/evemu/acquisition.hpp"

namespace abbe::daemon {

struct EvemuCandidate {
  calib::evemu::Observations observations;
  calib::evemu::Solution solution;
  calib::Verdict verdict;
};

/// `active` may be null. DataInsufficient or BadInput, with what is wrong with the touches, by
/// position and number. `stopped`: as in IdentificationWatch, asked while the run is judged. A run
/// without rotation reference is judged "shape only" unless [gate] accepts that by name.
[[nodiscard]] Result<EvemuCandidate> identify_touches(const EvemuRun& run, const Config& config,
                                                      const calib::VolumetricModel* active,
                                                      const std::function<bool()>& stopped = {});

[[nodiscard]] calib::evemu::TouchPlan touch_plan(const EvemuConfig& config);
/// Refused or BadInput if no model would come of it: no probe, a machine that has corrected its
/// positions, an array that grows nobody knows how far.
[[nodiscard]] Result<void> check_evemu(const EvemuRequest& request, const Config& config);
/// How the array grows and how warm it is: one without the other cannot be meant. What is wrong,
/// else empty. `named`: the calibrator, for people. `thermometer`: what says how warm it is; empty:
/// nothing does. `remedy`: how to have it said.
[[nodiscard]] std::string artefact_temperature_fault(const calib::evemu::Calibrator& calibrator,
                                                     std::string_view named,
                                                     std::string_view thermometer,
                                                     std::string_view remedy);
[[nodiscard]] EvemuAcquisitionOptions evemu_acquisition_options(const Config& config);

}  // namespace abbe::daemon
