#pragma once
/// The output of `abbe plan mfb`: plan.toml and the figures of the plan. Pure.

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "abbe/calib/mfb/plan/plan.hpp"
#include "abbe/calib/mfb/plan/plan_indexing.hpp"

namespace abbe::daemon {

/// A planned calibration with a Multi-Feature Bar.
struct BarPlan {
  std::string set;  ///< "rolled", or the name of the file with the set of positions that was judged
  calib::mfb::Plan plan;
  calib::mfb::PlanPrediction prediction;
  calib::mfb::ReadingRange readings;
  double duration_s = 0.0;
  /// The indexed positions, one per bar position, of a machine with rotary axes; else empty.
  std::vector<calib::mfb::IndexedPosition> indexed;
  /// Prediction for the initial set, from which positions were exchanged.
  std::optional<calib::mfb::PlanPrediction> start;
  std::vector<std::string> notes;
  std::vector<std::string> missing;  ///< measurements that are not possible with the styli

  [[nodiscard]] std::size_t positions() const;
  /// Number of measurements: passes in one direction.
  [[nodiscard]] std::size_t measurements() const;
  /// Number of times the bar is clamped.
  [[nodiscard]] std::size_t clampings() const;
};

/// The text of plan.toml in the form that read_bar_plan_toml() reads, with comments for people.
/// `machine`: name of the machine.
[[nodiscard]] std::string to_plan_toml(const BarPlan& plan, const calib::mfb::Bar& bar,
                                       const std::string& machine);
[[nodiscard]] nlohmann::json bar_plan_json(const BarPlan& plan, const calib::mfb::Bar& bar);

}  // namespace abbe::daemon
