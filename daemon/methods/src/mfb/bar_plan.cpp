#include "abbe/methods/mfb/bar_plan.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <numbers>
#include <set>

#include "abbe/base/units.hpp"

namespace abbe::daemon {
namespace {

using calib::mfb::Measurement;
using calib::mfb::PassDirection;

constexpr double kDegPerRad = 180.0 / std::numbers::pi;

/// The number with at most `digits` significant digits, as short as possible, without "-0".
std::string number(double value, int digits) {
  const std::string text = fmt::format("{:.{}g}", value, digits);
  return text == "-0" ? "0" : text;
}

std::string vector_mm(const calib::Vector3& v_m) {
  constexpr int kDigits = 10;  // 0.1 um in 10 m needs 8 digits
  return fmt::format("[{}, {}, {}]", number(v_m[0] * kMmPerM, kDigits),
                     number(v_m[1] * kMmPerM, kDigits), number(v_m[2] * kMmPerM, kDigits));
}

/// The direction, scaled so that its largest component is 1: 45 degrees give [1, 1, 0].
std::string direction(const calib::Vector3& v) {
  constexpr int kDigits = 9;
  constexpr double kZero = 1e-12;
  const double largest = v.cwiseAbs().maxCoeff();
  calib::Vector3 scaled = v / largest;
  for (double& component : scaled)
    if (std::abs(component) < kZero) component = 0.0;
  return fmt::format("[{}, {}, {}]", number(scaled[0], kDigits), number(scaled[1], kDigits),
                     number(scaled[2], kDigits));
}

nlohmann::json prediction_of_bar_json(const calib::mfb::PlanPrediction& p) {
  nlohmann::json errors = nlohmann::json::array();
  for (const auto& e : p.errors) {
    const double scale = e.is_angle ? kUradPerRad : kUmPerM;
    const bool seen = std::find(p.not_seen.begin(), p.not_seen.end(), e.name) == p.not_seen.end();
    errors.push_back({{"name", e.name},
                      {"rms_u", e.rms_u * scale},
                      {"max_u", e.max_u * scale},
                      {"unit", e.is_angle ? "urad" : "um"},
                      {"seen", seen}});
  }
  return {{"errors", errors},
          {"worst_of_limit", p.worst},
          {"observations", p.observations},
          {"unknowns", p.unknowns},
          {"rank", p.rank},
          {"condition", p.condition}};
}

std::string heading(const BarPlan& plan, const calib::mfb::Bar& bar, const std::string& machine) {
  std::string text = fmt::format(
      "# plan.toml: the measurements of a calibration with a Multi-Feature Bar, by abbe plan mfb.\n"
      "# Bar \"{}\", machine \"{}\", set \"{}\":\n"
      "# {} measurements{} in {} positions, {} clampings.\n"
      "# Lengths in mm, machine axes. Correct origin_mm, bar_x, bar_z where the bar was clamped\n"
      "# elsewhere: 5 mm and 20 mrad are permitted. Measure in this order.\n#\n"
      "# Readings of the axes at the touches:",
      bar.name, machine, plan.set, plan.measurements(),
      plan.plan.measurements.size() > plan.measurements() ? ", each forward and backward," : "",
      plan.positions(), plan.clampings());
  for (int k = 0; k < 3; ++k)
    text += fmt::format("{} {} {:.1f} to {:.1f}", k == 0 ? "" : ",", "XYZ"[k],
                        plan.readings.min_m[k] * kMmPerM, plan.readings.max_m[k] * kMmPerM);

  text += "\n# Predicted standard uncertainty (k = 1, largest over the nodes):\n";
  constexpr std::size_t kPerLine = 6;
  for (std::size_t i = 0; i < plan.prediction.errors.size(); ++i) {
    const auto& e = plan.prediction.errors[i];
    text += fmt::format("{}{} {:.2g} {}", i % kPerLine == 0 ? (i == 0 ? "#   " : "\n#   ") : ", ",
                        e.name, e.max_u * (e.is_angle ? kUradPerRad : kUmPerM),
                        e.is_angle ? "urad" : "um");
  }
  for (const auto& note : plan.notes) text += fmt::format("\n# {}", note);
  return text + "\n";
}

std::string settings(const calib::mfb::Plan& plan, bool expands) {
  std::string text = fmt::format("\n[plan]\ntip_radius_mm = {}    # of the stylus\n",
                                 number(plan.tip_radius_m * kMmPerM, 9));
  if (expands)
    text += fmt::format("u_temperature_K = {}    # of temperature_C, once per position\n",
                        number(plan.noise.u_temperature_K, 9));
  if (expands && plan.noise.u_common_temperature_K)
    text +=
        fmt::format("u_common_temperature_K = {}    # of the thermometer, at all positions alike\n",
                    number(*plan.noise.u_common_temperature_K, 9));
  if (plan.gravity != calib::Vector3(-calib::Vector3::UnitZ()))
    text += fmt::format("gravity = {}\n", direction(plan.gravity));
  return text + fmt::format(
                    "\n[noise]               # standard deviations (k = 1) of one touch\n"
                    "probe_um = {}        # along the normal of the surface\n"
                    "machine_um = {}       # repeatability, along each machine axis\n",
                    number(plan.noise.probe_m * kUmPerM, 9),
                    number(plan.noise.machine_m * kUmPerM, 9));
}

std::string measurement(const Measurement& m) {
  std::string text = fmt::format(
      "[[measurement]]\nname = \"{}\"\nposition = \"{}\"\norigin_mm = {}\nbar_x = {}\n"
      "bar_z = {}\ntool_offset_mm = {}\n",
      m.name, m.position, vector_mm(m.origin_m), direction(m.bar_x), direction(m.bar_z),
      vector_mm(m.tool_offset_m));
  if (m.direction == PassDirection::Backward) text += "pass = \"backward\"\n";
  if (m.temperature_K)
    text += fmt::format("temperature_C = {}    # enter the temperature of the bar in this pass\n",
                        number(*m.temperature_K - kZeroCelsius_K, 9));
  return text;
}

std::string clamping_of(const BarPlan& plan, std::size_t position) {
  if (plan.indexed.empty()) return "";
  const auto& at = plan.indexed[position];
  return fmt::format(": clamping {}, swivel axis {} degrees, rotary axis {} degrees",
                     at.clamping + 1, number(at.swivel_rad * kDegPerRad, 6),
                     number(at.turn_rad * kDegPerRad, 6));
}

}  // namespace

std::size_t BarPlan::positions() const {
  std::set<std::string> labels;
  for (const Measurement& m : plan.measurements) labels.insert(m.position);
  return labels.size();
}

std::size_t BarPlan::measurements() const {
  const auto pairs = calib::mfb::pairs_of(plan.measurements);
  return plan.measurements.size() -
         static_cast<std::size_t>(std::count_if(pairs.begin(), pairs.end(),
                                                [](auto& pair) { return pair.has_value(); }));
}

std::size_t BarPlan::clampings() const {
  return indexed.empty() ? positions() : calib::mfb::clampings_of(indexed);
}

std::string to_plan_toml(const BarPlan& plan, const calib::mfb::Bar& bar,
                         const std::string& machine) {
  std::string text = heading(plan, bar, machine) + settings(plan.plan, bar.expansion.has_value());
  std::string position;
  std::size_t number_of_position = 0;
  for (const Measurement& m : plan.plan.measurements) {
    text += "\n";
    if (m.position != position) {
      position = m.position;
      text += fmt::format("# Position {}{}\n", position, clamping_of(plan, number_of_position++));
    }
    text += measurement(m);
  }
  return text;
}

nlohmann::json bar_plan_json(const BarPlan& plan, const calib::mfb::Bar& bar) {
  constexpr double kMinute_s = 60.0;
  nlohmann::json readings;
  for (int k = 0; k < 3; ++k)
    readings[std::string(1, "XYZ"[k])] = {plan.readings.min_m[k] * kMmPerM,
                                          plan.readings.max_m[k] * kMmPerM};
  nlohmann::json object{{"set", plan.set},
                        {"measurements", plan.measurements()},
                        {"passes", plan.plan.measurements.size()},
                        {"touches_per_pass", bar.pattern.count()},
                        {"positions", plan.positions()},
                        {"clampings", plan.clampings()},
                        {"duration_min", plan.duration_s / kMinute_s},
                        {"readings_mm", readings},
                        {"prediction", prediction_of_bar_json(plan.prediction)},
                        {"not_seen", plan.prediction.not_seen},
                        {"missing", plan.missing},
                        {"notes", plan.notes}};
  for (std::size_t i = 0; i < plan.indexed.size(); ++i) {
    const auto& at = plan.indexed[i];
    object["indexing"].push_back({{"position", fmt::format("P{}", i + 1)},
                                  {"clamping", at.clamping + 1},
                                  {"swivel_deg", at.swivel_rad * kDegPerRad},
                                  {"turn_deg", at.turn_rad * kDegPerRad}});
  }
  if (plan.start) object["before_exchange"] = prediction_of_bar_json(*plan.start);
  return object;
}

}  // namespace abbe::daemon
