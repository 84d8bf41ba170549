#pragma once
/// Identification with a Multi-Feature Bar: its input, and the judged result that is stored and
/// reported.

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

/// The measured touches, and how the model is identified from them.
struct MfbTask {
  calib::mfb::Bar bar;
  calib::mfb::Plan plan;
  std::vector<calib::mfb::PassTouches> passes;  ///< one per measurement of the plan
  calib::mfb::Options options;
  /// Options of the Monte Carlo check of the first-order uncertainties; nullopt: no check.
  std::optional<calib::mfb::MonteCarloOptions> monte_carlo{};
};

/// A judged model.
struct MfbCandidate {
  calib::mfb::Identification found;
  calib::Verdict verdict;
  std::optional<calib::mfb::MonteCarlo> monte_carlo;
};

using MfbProgress = std::function<void(std::string_view step, double share)>;

/// Identifies a model and judges it. `task` has a valid bar and plan; an error of the
/// identification is therefore caused by the data and is DataInsufficient. `active`: the model in
/// use; may be null. `progress` is called with the name of each step and the fraction of it that is
/// done.
[[nodiscard]] Result<MfbCandidate> identify_with_bar(const MfbTask& task, const Config& config,
                                                     const calib::VolumetricModel* active,
                                                     const MfbProgress& progress = {});

}  // namespace abbe::daemon
