#pragma once
/// A path for a calibration on the fly, planned or given, with the uncertainty that it will give.

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

/// As a person gives them; lengths in the unit of the name.
struct PlanOtfArguments {
  std::string machine, path;  ///< files; without `machine`: chain, tool and travel below
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
  std::vector<std::pair<calib::Vector3, double>> trackers;  ///< position, rms_u_m
  std::size_t corners_not_reached = 0;
  bool ended_early = false;  ///< by Progress::stopped()
};

/// With `arguments.path` a prediction of that path, else a new path: the best one found until it is
/// `progress.stopped()`. Usage: the place of the tracker is not known. DataInsufficient: stopped
/// before there was a path.
[[nodiscard]] Result<PathPlan> plan_otf(const PlanOtfArguments&, const Progress&);

}  // namespace abbe::daemon
