#include "bar_drawing.hpp"

#include <string>

#include "abbe/base/units.hpp"
#include "abbe/tables/mfb_files.hpp"

namespace abbe::web {

nlohmann::json bars_of(const nlohmann::json& request) {
  using nlohmann::json;
  json bars = json::array();
  if (!request.is_object() || !request.contains("plan")) return bars;
  const auto text = [&request](const char* file, const char* member) {
    return request.at(file).at(member).get<std::string>();
  };
  const auto bar = daemon::parse_bar_toml(text("bar", "text"), text("bar", "file"));
  if (!bar) return bars;
  const auto plan =
      daemon::parse_bar_plan_toml(text("plan", "text"), text("plan", "file"), bar->bar);
  if (!plan) return bars;

  for (const calib::mfb::Measurement& m : plan->plan.measurements) {
    json holes_mm = json::array();
    for (const calib::Vector3& O_m : bar->bar.O_m) {
      const calib::Vector3 at_mm = daemon::kMmPerM * (m.origin_m + m.axes() * O_m);
      holes_mm.push_back({at_mm.x(), at_mm.y(), at_mm.z()});
    }
    bars.push_back({{"measurement", m.name}, {"holes_mm", std::move(holes_mm)}});
  }
  return bars;
}

}  // namespace abbe::web
