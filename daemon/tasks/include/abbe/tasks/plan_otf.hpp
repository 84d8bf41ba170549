#pragma once
/// A path for an on-the-fly calibration, planned or given, with the predicted uncertainty.

#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/calib/otf/plan/plan.hpp"
#include "abbe/tasks/progress.hpp"

namespace abbe::daemon {

inline constexpr double kMinute_s = 60.0;

/// Arguments as given by the user; lengths in the unit of their name.
struct PlanOtfArguments {
  /// files; without `machine` the chain, tool and travel below are used
  std::string machine, path;
  std::string chain = "[w b X Y Z t]", tool = "0,0,0";
  std::vector<double> travel_mm;
  double node_spacing_mm = 50.0;
  std::vector<std::string> trackers;
  double feed_mm_per_min = 2500.0;
  std::optional<double> length_m, budget_min, points_per_s;
  calib::otf::Drive drive;
  std::size_t lattice = calib::otf::PlanOptions{}.lattice,
              exchanges = calib::otf::PlanOptions{}.exchanges;
};

/// A path with its prediction, and the tracker positions that were compared.
struct PathPlan {
  calib::otf::PlannedRun run;
  calib::otf::Path path;
  calib::otf::Prediction prediction;
  tl::expected<calib::otf::Prediction, calib::Error> base;
  /// position of a tracker, and the rms of the predicted standard uncertainty
  std::vector<std::pair<calib::Vector3, double>> trackers;
  std::size_t corners_not_reached = 0;
  bool ended_early = false;  ///< true: Progress::stopped() ended the search
};

/// If `arguments.path` is given: a prediction for this path. Else a new path: the best path found
/// until the search ends or `progress.stopped()` is true. Usage: the position of the tracker is not
/// known. DataInsufficient: stopped before a path was found.
[[nodiscard]] Result<PathPlan> plan_otf(const PlanOtfArguments&, const Progress&);

}  // namespace abbe::daemon
