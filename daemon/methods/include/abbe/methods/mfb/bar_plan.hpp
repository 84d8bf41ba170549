#pragma once
/// What `abbe plan mfb` writes and prints: plan.toml and the figures of the plan. Pure.

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "abbe/calib/mfb/plan/plan.hpp"
#include "abbe/calib/mfb/plan/plan_indexing.hpp"

namespace abbe::daemon {

/// A planned calibration with a Multi-Feature Bar.
struct BarPlan {
  std::string set;  ///< "rolled", or the name of the file that was judged
  calib::mfb::Plan plan;
  calib::mfb::PlanPrediction prediction;
  calib::mfb::ReadingRange readings;
  double duration_s = 0.0;
  /// With rotary axes, one for each position; else empty.
  std::vector<calib::mfb::IndexedPosition> indexed;
  /// Of the set whose positions were exchanged.
  std::optional<calib::mfb::PlanPrediction> start;
  std::vector<std::string> notes;
  std::vector<std::string> missing;  ///< measurements that the styli do not permit

  [[nodiscard]] std::size_t positions() const;
  /// Passes in one direction.
  [[nodiscard]] std::size_t measurements() const;
  /// Clampings of the bar.
  [[nodiscard]] std::size_t clampings() const;
};

/// The file as read_bar_plan_toml() reads it, with comments for people. `machine`: its name.
[[nodiscard]] std::string to_plan_toml(const BarPlan& plan, const calib::mfb::Bar& bar,
                                       const std::string& machine);
[[nodiscard]] nlohmann::json bar_plan_json(const BarPlan& plan, const calib::mfb::Bar& bar);

}  // namespace abbe::daemon
