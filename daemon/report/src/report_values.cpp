#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "abbe/base/units.hpp"
#include "report_sections.hpp"

namespace abbe::daemon {
namespace {

/// A curve in um over mm.
Curve curve_of_values(std::string name, const std::vector<double>& positions_m,
                      const std::vector<calib::iso::Value>& values) {
  Curve curve{.name = std::move(name), .x = {}, .y = {}};
  for (std::size_t i = 0; i < values.size(); ++i) {
    curve.x.push_back(kMmPerM * positions_m[i]);
    curve.y.push_back(kUmPerM * values[i].value);
    curve.u.push_back(kUmPerM * values[i].u);
  }
  return curve;
}

}  // namespace

std::string with_U(const CertifiedValue& value) {
  if (value.value.empty()) return fmt::format("not estimable: {}", value.why);
  const std::string_view unit = value.is_angle ? "urad" : "um";
  return value.U.empty() ? fmt::format("{} {}", value.value, unit)
                         : fmt::format("{} \u00b1 {} {}", value.value, value.U, unit);
}

std::string box_in_words(const calib::iso::StandardValues& standard) {
  const calib::iso::LineBox& box = standard.box;
  std::string text = "Box: ";
  for (const calib::Axis axis : calib::kAllAxes) {
    const auto a = static_cast<Eigen::Index>(index(axis));
    text += fmt::format("{}{} {:.1f} to {:.1f} mm", axis == calib::Axis::X ? "" : ", ",
                        letter(axis), kMmPerM * box.low_m(a), kMmPerM * box.high_m(a));
  }
  return text + (box.whole ? ", the bounding box of the validity volume."
                           : ", inside the validity volume, whose bounding box has corners "
                             "without data.");
}

void add_values(HtmlReport& page, const CertifiedValues& values, std::size_t first,
                std::size_t last) {
  for (std::size_t g = first; g < std::min(last, values.groups.size()); ++g) {
    const ValueGroup& group = values.groups[g];
    page.heading(group.name);
    page.paragraph(group.explanation);
    std::vector<std::vector<std::string>> rows;
    for (const CertifiedValue& v : group.values)
      if (!v.value.empty())
        rows.push_back({v.name, v.value, v.U.empty() ? "-" : v.U, v.is_angle ? "urad" : "um"});
    if (!rows.empty()) page.table({"", "value", "U (k = 2)", "unit"}, rows);
  }
}

void add_not_estimable(HtmlReport& page, const CertifiedValues& values) {
  std::map<std::string, std::string> keys_of_reason;
  for (const ValueGroup& group : values.groups)
    for (const CertifiedValue& v : group.values) {
      if (!v.value.empty()) continue;
      std::string& keys = keys_of_reason[v.why];
      keys += (keys.empty() ? "" : ", ") + v.key;
    }
  std::string text;
  for (const auto& [why, keys] : keys_of_reason)
    text += fmt::format("{}{} ({})", text.empty() ? "" : "; ", keys, why);
  if (!text.empty()) page.paragraph(fmt::format("Not estimable: {}.", text));
}

Curve positioning_curve(const calib::iso::Positioning& positioning, std::string name) {
  return curve_of_values(std::move(name), positioning.targets_m, positioning.mean);
}

Curve diagonal_curve(const calib::iso::Diagonal& diagonal, std::string name) {
  return curve_of_values(std::move(name), diagonal.along_m, diagonal.mean);
}

void add_value_curves(HtmlReport& page, const CertifiedValues& values) {
  page.heading("The same as curves");
  page.paragraph(
      "Bands: U = 2 u (k = 2). Where all bands of a chart are too narrow to be seen, a second "
      "panel shows U. Positioning and diagonals: relative to their first point, where u is 0.");
  for (const calib::Axis axis : calib::kAllAxes) {
    const calib::iso::Positioning& p = values.standard.positioning[index(axis)];
    page.plot({.title = fmt::format("Positioning of {}", letter(axis)),
               .x_label = fmt::format("{}, mm", letter(axis)),
               .y_label = "um",
               .curves = {positioning_curve(p, fmt::format("E{0}{0}", letter(axis)))}});
    LineChart chart{.title = fmt::format("Straightness of {}", letter(axis)),
                    .x_label = fmt::format("{}, mm", letter(axis)),
                    .y_label = "um"};
    for (const calib::iso::Straightness& s : values.standard.straightness)
      if (s.motion.axis == axis)
        chart.curves.push_back(curve_of_values(calib::name(s.motion), p.targets_m, s.deviation));
    page.plot(chart);
  }

  LineChart chart{.title = "Diagonals (ISO 230-6)",
                  .x_label = "along the diagonal, mm",
                  .y_label = "um",
                  .wide = true};
  for (const calib::iso::Diagonal& d : values.standard.diagonals)
    chart.curves.push_back(diagonal_curve(d, d.name));
  page.plot(chart);
}

void add_field(HtmlReport& page, const calib::VolumetricModel& model,
               const calib::iso::LineBox& box) {
  constexpr int kPerSide = 4;
  constexpr double kLongest = 0.12;  // fraction of the diagonal of the box
  const calib::Vector3 step_m = (box.high_m - box.low_m) / (kPerSide - 1.0);
  const calib::Vector3 tool_m = model.tool_offsets_m().front();
  std::vector<std::pair<calib::Vector3, calib::Vector3>> vectors;
  double longest_m = 0.0;
  for (int i = 0; i < kPerSide * kPerSide * kPerSide; ++i) {
    const calib::Vector3 at(i % kPerSide, i / kPerSide % kPerSide, i / kPerSide / kPerSide);
    const calib::Vector3 q_m = box.low_m + step_m.cwiseProduct(at);
    vectors.emplace_back(q_m, model.V_at(q_m, tool_m));
    longest_m = std::max(longest_m, vectors.back().second.norm());
  }

  if (!(longest_m > 0.0)) return;
  const double magnification = kLongest * (box.high_m - box.low_m).norm() / longest_m;
  SpaceDrawing drawing{
      .title = fmt::format("V in the box, longest vector {:.1f} um", kUmPerM * longest_m),
      .box_mm = {kMmPerM * box.low_m, kMmPerM * box.high_m},
      .lines = {}};
  drawing.one_colour = true;
  for (const auto& [q_m, V_m] : vectors)
    drawing.lines.push_back({"", kMmPerM * q_m, kMmPerM * (q_m + magnification * V_m)});
  page.heading("The error in space");
  page.paragraph("Dot: scale reading. Line: V there, magnified, in the datum of the model.");
  page.drawing(drawing);
}

}  // namespace abbe::daemon
