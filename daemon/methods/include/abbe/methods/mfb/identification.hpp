#pragma once
/// An identification with a Multi-Feature Bar as it is judged, stored and reported.

#include <functional>
#include <optional>
#include <span>

#include "abbe/base/error.hpp"
#include "abbe/calib/mfb/identify/monte_carlo.hpp"
#include "abbe/calib/mfb/judge/judge.hpp"
#include "abbe/calib/mfb/solve/identify.hpp"
#include "abbe/calib/model/gate.hpp"
#include "abbe/config/config.hpp"

namespace abbe::daemon {

/// What was measured, and how it is identified.
struct MfbTask {
  calib::mfb::Bar bar;
  calib::mfb::Plan plan;
  std::vector<calib::mfb::PassTouches> passes;  ///< one per measurement of the plan
  calib::mfb::Options options;
  /// Without: the uncertainties of the first order are not checked.
  std::optional<calib::mfb::MonteCarloOptions> monte_carlo{};
};

/// A judged model.
struct MfbCandidate {
  calib::mfb::Identification found;
  calib::Verdict verdict;
  std::optional<calib::mfb::MonteCarlo> monte_carlo;
};

using MfbProgress = std::function<void(std::string_view step, double share)>;

/// `task`: bar and plan are valid, so that an error of the identification is one of the data:
/// DataInsufficient. `active`, the model in use, may be null. `progress`: called
/// with the name of each step and its share done.
[[nodiscard]] Result<MfbCandidate> identify_with_bar(const MfbTask& task, const Config& config,
                                                     const calib::VolumetricModel* active,
                                                     const MfbProgress& progress = {});

}  // namespace abbe::daemon
