// Reads gauge.toml: a step gauge measured on the line of a bar.
#include "abbe/tables/gauge_file.hpp"

#include <fmt/format.h>

#include <cmath>
#include <optional>
#include <string_view>

#include "abbe/base/units.hpp"
#include "abbe/result/try.hpp"
#include "expansivity.hpp"
#include "toml_file.hpp"

namespace abbe::daemon {
namespace {

using calib::mfb::GaugeFace;
using calib::mfb::StepGauge;

enum class GaugeReadings { Required, AllOrNone };

void read_gauge_head(Section head, StepGauge& out) {
  if (!head.present()) return;
  head.get("name", out.name, Need::Required);
  get_vector(head, "origin_mm", out.origin_m, kMilli, Need::Required);
  get_vector(head, "tool_offset_mm", out.tool_offset_m, kMilli, Need::Required);
  head.get("u_um", out.u_m, kMicro, kNotNegative, Need::Required);
  head.get("u_um_per_m", out.u_per_m, kMicro, kNotNegative, Need::Required);
  read_expansivity(head, out.expansion);

  double temperature_C = 0.0;
  const Need need = out.expansion ? Need::Required : Need::Optional;
  if (head.get("temperature_C", temperature_C, kPlain, {-50.0, 100.0}, need))
    out.temperature_K = temperature_C + kZeroCelsius_K;
  head.get("u_temperature_K", out.u_temperature_K, kPlain, {0.0, 50.0});
  double u_rotation_rad = 0.0;
  if (head.get("u_rotation_urad", u_rotation_rad, kMicro, kNotNegative))
    out.u_rotation_rad = u_rotation_rad;
  double u_alignment_rad = 0.0;
  if (head.get("u_alignment_mrad", u_alignment_rad, kMilli, {0.0, 20.0}))
    out.u_alignment_rad = u_alignment_rad;
  head.close();
}

/// Reads the readings [x, y, z] of each run. False after a fault, or if the key is missing.
bool get_readings(Section& step, Need need, std::vector<calib::Vector3>& out) {
  constexpr std::string_view kKey = "readings_mm";
  const toml::node* node = step.node(kKey);
  if (node == nullptr) {
    if (need == Need::Required) step.fault(kKey, "missing");
    return false;
  }
  const toml::array* runs = node->as_array();
  bool valid = runs != nullptr;
  for (std::size_t r = 0; valid && r < runs->size(); ++r) {
    const toml::array* reading = runs->get(r)->as_array();
    valid = reading != nullptr && reading->size() == 3;
    calib::Vector3 q_m;
    for (std::size_t k = 0; valid && k < 3; ++k) {
      const auto value = reading->get(k)->value<double>();
      valid = value && std::isfinite(*value);
      if (valid) q_m(static_cast<Eigen::Index>(k)) = *value / kMmPerM;
    }
    if (valid) out.push_back(q_m);
  }
  if (valid) return true;
  step.fault(kKey, "must be [x, y, z] of each run: the readings of all three axes");
  return false;
}

/// Reads the faces of the gauge. Their distances must ascend from 0, and every face must have the
/// same number of readings.
void read_faces(Section& root, GaugeReadings readings, StepGauge& out) {
  const bool required = readings == GaugeReadings::Required;
  for (Section& step : root.children("step")) {
    GaugeFace face;
    const bool placed =
        step.get("distance_mm", face.distance_m, kMilli, kNotNegative, Need::Required);
    const bool measured =
        get_readings(step, required ? Need::Required : Need::Optional, face.readings_m);
    const bool first = out.faces.empty();
    if (!required && !first && measured == out.faces.front().readings_m.empty())
      step.fault("readings_mm", measured ? "the first [[step]] has none: all have them or none"
                                         : "is missing: all have them or none");
    step.close();

    if (placed && first && face.distance_m != 0.0)
      step.fault("distance_mm",
                 fmt::format("{:g}: distances are from the first face, which is at 0",
                             kMmPerM * face.distance_m));
    if (placed && !first && face.distance_m <= out.faces.back().distance_m)
      step.fault("distance_mm",
                 fmt::format("{:g} after {:g}: must ascend", kMmPerM * face.distance_m,
                             kMmPerM * out.faces.back().distance_m));
    if (measured && face.readings_m.empty())
      step.fault("readings_mm", "is empty: needs the reading of one or more runs");
    if (measured && !first && (required || !out.faces.front().readings_m.empty()) &&
        face.readings_m.size() != out.faces.front().readings_m.size())
      step.fault("readings_mm",
                 fmt::format("{} readings, the first face has {}: one per run",
                             face.readings_m.size(), out.faces.front().readings_m.size()));
    out.faces.push_back(std::move(face));
  }
  if (out.faces.size() < 2) root.fault("step", "needs at least two [[step]]");
}

Result<GaugeFile> read_gauge(const std::filesystem::path& file, GaugeReadings readings) {
  const auto parsed = parse_toml_file(file);
  ABBE_TRY(parsed);
  Faults faults(file.string());
  Section root(&parsed->table, "", {1, 1}, faults);
  GaugeFile out{parsed->source, {}};
  read_gauge_head(root.child("gauge", Need::Required), out.gauge);
  read_faces(root, readings, out.gauge);
  root.close();
  if (faults.any()) return tl::make_unexpected(faults.to_error());
  return out;
}

}  // namespace

Result<GaugeFile> read_gauge_toml(const std::filesystem::path& file) {
  return read_gauge(file, GaugeReadings::Required);
}

Result<GaugeFile> read_gauge_to_measure(const std::filesystem::path& file) {
  return read_gauge(file, GaugeReadings::AllOrNone);
}

}  // namespace abbe::daemon
