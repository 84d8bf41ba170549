#include "abbe/methods/otf/path_plan.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "abbe/base/units.hpp"

namespace abbe::daemon {
namespace {

/// True for errors such as EAX and EC0Y, in rad; false for EXX and EZY, in m.
bool is_angle(const std::string& iso_name) {
  return iso_name.size() > 1 && iso_name[1] >= 'A' && iso_name[1] <= 'C';
}

nlohmann::json uncertainties_json(const std::vector<calib::otf::TableUncertainty>& all) {
  nlohmann::json tables = nlohmann::json::array();
  for (const auto& table : all) {
    const bool angle = is_angle(table.name);
    const double scale = angle ? kUradPerRad : kUmPerM;
    tables.push_back({{"name", table.name},
                      {"rms_u", table.rms_u * scale},
                      {"max_u", table.max_u * scale},
                      {"unit", angle ? "urad" : "um"}});
  }
  return tables;
}

}  // namespace

std::string to_path_csv(const calib::otf::Path& path, double feed_m_per_s) {
  constexpr double kPerMinute = 60.0;
  std::string text = "x_mm,y_mm,z_mm,feed_mm_per_min\n";
  for (const calib::Vector3& q : path.vertices_m) {
    text += fmt::format("{:.10g},{:.10g},{:.10g},{:.10g}\n", q[0] * kMmPerM, q[1] * kMmPerM,
                        q[2] * kMmPerM, feed_m_per_s * kMmPerM * kPerMinute);
  }
  return text;
}

std::string to_map_csv(const calib::otf::Prediction& prediction) {
  std::string text = "x_mm,y_mm,z_mm,u_um\n";
  for (const auto& [q, u_m] : prediction.map) {
    text += fmt::format("{:.10g},{:.10g},{:.10g},{:.4g}\n", q[0] * kMmPerM, q[1] * kMmPerM,
                        q[2] * kMmPerM, u_m * kUmPerM);
  }
  return text;
}

nlohmann::json prediction_json(const calib::otf::Prediction& p) {
  nlohmann::json object{{"rms_u_um", p.rms_u_m * kUmPerM},
                        {"max_u_um", p.max_u_m * kUmPerM},
                        {"length_m", p.length_m},
                        {"duration_s", p.duration_s},
                        {"observations", p.observations},
                        {"unknowns", p.unknowns},
                        {"rank", p.rank},
                        {"datum_conditions", p.datum_defect},
                        {"condition", p.condition},
                        {"not_observable", p.left_out},
                        {"tables", uncertainties_json(p.tables)}};
  if (!p.backlash.empty()) object["backlash"] = uncertainties_json(p.backlash);
  if (!p.unused.empty()) object["unused"] = p.unused;
  return object;
}

}  // namespace abbe::daemon
