#pragma once
/// Identifies the 21 errors of three linear axes with a Multi-Feature Bar: from files, or from a
/// recording.

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/calib/mfb/identify/monte_carlo.hpp"
#include "abbe/methods/mfb/identification.hpp"
#include "abbe/model/model_document.hpp"
#include "abbe/tasks/progress.hpp"

namespace abbe::daemon {

/// Arguments as given by the user: file names and values.
struct IdentifyMfbArguments {
  std::string machine, bar, plan, points, recording, keep;
  std::string estimator{calib::mfb::name(calib::mfb::Estimator::Simultaneous)};
  std::size_t trials = 0;  ///< number of Monte Carlo trials; 0: none
  std::uint64_t seed = calib::mfb::MonteCarloOptions{}.seed;
  bool scales_corrected = false;
  std::vector<std::string> accept{};  ///< see accept_also()
};

struct MfbOutcome {
  MfbCandidate candidate;
  ModelDocument document;
};
/// Errors about touches name file, line and feature.
[[nodiscard]] Result<MfbOutcome> identify_mfb(const IdentifyMfbArguments&, const Progress&);

}  // namespace abbe::daemon
