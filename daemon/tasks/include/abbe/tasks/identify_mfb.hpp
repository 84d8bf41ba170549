#pragma once
/// The 21 errors of three linear axes from a Multi-Feature Bar: from files, or from a recording.

#include <cstddef>
#include <cstdint>
#include <string>

#include "abbe/base/error.hpp"
#include "abbe/calib/mfb/identify/monte_carlo.hpp"
#include "abbe/methods/mfb/identification.hpp"
#include "abbe/model/model_document.hpp"
#include "abbe/tasks/progress.hpp"

namespace abbe::daemon {

/// File names and values as a person gives them.
struct IdentifyMfbArguments {
  std::string machine, bar, plan, points, recording, keep;
  std::string estimator{calib::mfb::name(calib::mfb::Estimator::Simultaneous)};
  std::size_t trials = 0;  ///< 0: no Monte Carlo
  std::uint64_t seed = calib::mfb::MonteCarloOptions{}.seed;
  bool scales_corrected = false;
};

struct MfbOutcome {
  MfbCandidate candidate;
  ModelDocument document;
};
/// Errors of touches name file, line and feature.
[[nodiscard]] Result<MfbOutcome> identify_mfb(const IdentifyMfbArguments&, const Progress&);

}  // namespace abbe::daemon
