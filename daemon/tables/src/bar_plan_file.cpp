// Reads plan.toml: the measurements of a calibration with a Multi-Feature Bar.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <string>

#include "abbe/base/units.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tables/mfb_files.hpp"
#include "toml_file.hpp"

namespace abbe::daemon {
namespace {

using calib::mfb::Bar;
using calib::mfb::Measurement;
using calib::mfb::PassDirection;
using calib::mfb::Plan;

/// The reason why a row of points.csv cannot contain this name of a measurement; empty: it can.
std::string_view fault_of_name(std::string_view name) {
  constexpr std::string_view kBlank = " \t";
  if (name.find_first_of(",\r\n\"") != std::string_view::npos)
    return "has a comma, a quotation mark or a line break: rows of the touches name it";
  if (kBlank.find(name.front()) != std::string_view::npos ||
      kBlank.find(name.back()) != std::string_view::npos)
    return "begins or ends with a blank";
  return name.front() == '#' ? "begins with #, as a comment does in the file of the touches" : "";
}

/// Reads a direction of any length except 0; `out` is a unit vector.
bool get_direction(Section& section, std::string_view key, calib::Vector3& out,
                   Need need = Need::Optional) {
  calib::Vector3 given = calib::Vector3::Zero();
  if (!get_vector(section, key, given, kPlain, need)) return false;
  const double length = given.norm();
  if (!(length > 0.0) || !std::isfinite(length)) {
    section.fault(key, "is no direction: its length is 0");
    return false;
  }
  out = given / length;
  return true;
}

/// Reads the measurements of a plan, one after the other.
class MeasurementReader {
 public:
  explicit MeasurementReader(bool needs_temperature) : needs_temperature_(needs_temperature) {}

  void read(Section& section) {
    Measurement m;
    if (section.get("name", m.name, Need::Required)) check_name(section, m.name);
    const bool labelled = section.get("position", m.position, Need::Required);
    const bool placed = read_pose(section, m);
    get_vector(section, "tool_offset_mm", m.tool_offset_m, kMilli, Need::Required);
    section.get_word<PassDirection>(
        "pass", m.direction,
        {{"forward", PassDirection::Forward}, {"backward", PassDirection::Backward}});
    m.temperature_K = read_temperature(section);
    section.close();
    if (labelled && placed) check_same_pose(section, m);
    measurements_.push_back(std::move(m));
  }
  [[nodiscard]] std::vector<Measurement> take() { return std::move(measurements_); }

 private:
  void check_name(Section& section, const std::string& name) {
    if (const auto fault = fault_of_name(name); !fault.empty()) section.fault("name", fault);
    if (!names_.insert(name).second)
      section.fault("name", fmt::format("two measurements have the name \"{}\"", name));
  }

  std::optional<double> read_temperature(Section& section) const {
    double temperature_C = 0.0;
    const Need need = needs_temperature_ ? Need::Required : Need::Optional;
    if (!section.get("temperature_C", temperature_C, kPlain, {-50.0, 100.0}, need)) return {};
    return temperature_C + kZeroCelsius_K;
  }

  static bool read_pose(Section& section, Measurement& m) {
    constexpr double kMostFromPerpendicular = 1e-3;
    const bool placed = get_vector(section, "origin_mm", m.origin_m, kMilli, Need::Required);
    const bool x = get_direction(section, "bar_x", m.bar_x, Need::Required);
    const bool z = get_direction(section, "bar_z", m.bar_z, Need::Required);
    if (!x || !z) return false;
    const double off_rad = std::asin(std::clamp(std::abs(m.bar_x.dot(m.bar_z)), 0.0, 1.0));
    if (off_rad <= kMostFromPerpendicular) return placed;
    section.fault("bar_z", fmt::format("is {:.3g} mrad from perpendicular to bar_x, at most 1",
                                       1e3 * off_rad));
    return false;
  }

  /// Checks that all measurements of one clamping have the same pose.
  void check_same_pose(Section& section, const Measurement& m) {
    constexpr double kSame_m = 1e-9, kSame_rad = 1e-9;
    const auto [at, is_new] = poses_.try_emplace(m.position, m);
    const Measurement& first = at->second;
    if (is_new) return;
    const auto differs = [&](std::string_view key) {
      section.fault(key, fmt::format("differs from that of \"{}\", which has the same position "
                                     "\"{}\": a bar that was clamped again has another position",
                                     first.name, m.position));
    };
    if ((first.origin_m - m.origin_m).norm() > kSame_m) differs("origin_mm");
    if ((first.bar_x - m.bar_x).norm() > kSame_rad) differs("bar_x");
    if ((first.bar_z - m.bar_z).norm() > kSame_rad) differs("bar_z");
  }

  bool needs_temperature_;
  std::vector<Measurement> measurements_;
  std::set<std::string> names_;
  std::map<std::string, Measurement> poses_;  ///< poses by position
};

void read_noise(Section noise, calib::mfb::TouchNoise& out) {
  if (!noise.present()) return;
  const bool probe = noise.get("probe_um", out.probe_m, kMicro, kNotNegative, Need::Required);
  const bool machine = noise.get("machine_um", out.machine_m, kMicro, kNotNegative, Need::Required);
  if (probe && machine && out.probe_m == 0.0 && out.machine_m == 0.0)
    noise.fault("probe_um", "and machine_um are 0: every touch has noise");
  noise.close();
}

void read_head(Section head, const Bar& bar, Plan& out) {
  if (!head.present()) return;
  const double hole_m = bar.pattern.hole_radius_m;
  if (head.get("tip_radius_mm", out.tip_radius_m, kMilli, kNotNegative, Need::Required) &&
      out.tip_radius_m >= hole_m)
    head.fault("tip_radius_mm", fmt::format("{} does not fit into holes of radius {} mm",
                                            out.tip_radius_m * kMmPerM, hole_m * kMmPerM));
  head.get("u_temperature_K", out.noise.u_temperature_K, kPlain, {0.0, 50.0});
  double common_K = 0.0;
  if (head.has("u_common_temperature_K") &&
      head.get("u_common_temperature_K", common_K, kPlain, {0.0, 50.0}))
    out.noise.u_common_temperature_K = common_K;
  get_direction(head, "gravity", out.gravity);
  head.close();
}

Plan read_plan(Section& root, const toml::table& table, const Bar& bar,
               std::vector<std::size_t>& lines) {
  Plan plan;
  read_head(root.child("plan", Need::Required), bar, plan);
  read_noise(root.child("noise", Need::Required), plan.noise);
  MeasurementReader reader(bar.expansion.has_value());
  for (Section& measurement : root.children("measurement")) reader.read(measurement);
  plan.measurements = reader.take();
  if (plan.measurements.empty()) root.fault("measurement", "needs at least one [[measurement]]");

  if (const toml::array* all = table["measurement"].as_array())
    for (const toml::node& one : *all) lines.push_back(one.source().begin.line);
  return plan;
}

}  // namespace

Result<BarPlanFile> read_bar_plan_toml(const std::filesystem::path& file, const Bar& bar) {
  const auto text = read_text(file);
  ABBE_TRY(text);
  return parse_bar_plan_toml(*text, file, bar);
}

Result<BarPlanFile> parse_bar_plan_toml(std::string_view text, const std::filesystem::path& file,
                                        const Bar& bar) {
  const auto parsed = parse_toml_text(text, file);
  ABBE_TRY(parsed);
  Faults faults(file.string());
  Section root(&parsed->table, "", {1, 1}, faults);
  BarPlanFile out{parsed->source, {}, {}};
  out.plan = read_plan(root, parsed->table, bar, out.lines);
  root.close();
  if (faults.any()) return tl::make_unexpected(faults.to_error());
  if (const auto valid = calib::mfb::check(out.plan, bar); !valid)
    return fail(ErrorCode::BadInput, fmt::format("{}: {}", file.string(), valid.error().text));
  return out;
}

}  // namespace abbe::daemon
