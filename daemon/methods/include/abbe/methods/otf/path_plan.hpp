#pragma once
/// The output of `abbe plan otf`: path.csv, map.csv and the figures of plan.json. Pure.

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "abbe/calib/otf/plan/plan_prediction.hpp"

namespace abbe::daemon {

/// The text of path.csv, with the feed of each leg.
[[nodiscard]] std::string to_path_csv(const calib::otf::Path& path, double feed_m_per_s);
/// The text of map.csv, with the columns `x_mm,y_mm,z_mm,u_um`.
[[nodiscard]] std::string to_map_csv(const calib::otf::Prediction& prediction);
/// The figures of a prediction, without its map.
[[nodiscard]] nlohmann::json prediction_json(const calib::otf::Prediction& prediction);

}  // namespace abbe::daemon
