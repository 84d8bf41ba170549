#pragma once
/// Searches the set of positions with the smallest worst uncertainty (PlanPrediction::worst). The
/// search begins with a given set. It replaces positions by candidates (candidate_positions()) with
/// the same number of styli, as long as the mean uncertainty decreases and the worst one does not
/// increase. Deterministic. Units: m, rad, s.

#include <functional>

#include "abbe/calib/mfb/plan/plan_positions.hpp"
#include "abbe/calib/mfb/plan/plan_prediction.hpp"

namespace abbe::calib::mfb {

struct ChoiceOptions {
  SolveOptions solve;
  std::size_t exchanges = 60;  ///< largest number of exchanges
  /// Called between evaluations; true: stop.
  std::function<bool()> stopped = {};
  std::function<void(double)> progress = {};  ///< called with values from 0 to 1
};

struct ChosenSet {
  std::vector<PlannedPosition> positions;
  PlanPrediction prediction;
  PlanPrediction start;  ///< prediction of the set at the beginning
  std::size_t candidates = 0, exchanged = 0;
};

/// Searches from `start`. The result is never worse than `start` and has the same number of
/// positions and measurements. The errors of predict(); NotConverged if stopped.
[[nodiscard]] Result<ChosenSet> choose_set(const PlanTask&,
                                           const std::vector<PlannedPosition>& start,
                                           const ChoiceOptions& = {});

/// Speeds and distances with which the machine probes.
struct TouchDrive {
  double feed_m_per_s = 2.0 / 60.0;  ///< between touches
  double probing_feed_m_per_s = 4e-3;
  double approach_m = 3e-3;  ///< to the surface and back, at the probing feed
};
/// Time of all passes, without clamping.
[[nodiscard]] double duration_s(const Bar&, const Plan&, const TouchDrive&);

}  // namespace abbe::calib::mfb
