#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "abbe/base/units.hpp"
#include "abbe/calib/model/model_comparison.hpp"
#include "abbe/report/model_words.hpp"
#include "abbe/report/sections.hpp"
#include "abbe/result/try.hpp"
#include "report_sections.hpp"

namespace abbe::daemon {
namespace {

struct Sides {
  const ReportSubject& a;
  const ReportSubject& b;
  CertifiedValues values_a, values_b;
};

/// The nodes of both models that are inside both validity volumes.
std::vector<calib::Vector3> nodes_of_both(const calib::VolumetricModel& a,
                                          const calib::VolumetricModel& b) {
  std::vector<calib::Vector3> points_m;
  for (const auto* nodes : {&a.nodes(), &b.nodes()})
    for (const calib::Vector3& q_m : calib::tensor_grid(*nodes))
      if (a.validity().contains(q_m) && b.validity().contains(q_m)) points_m.push_back(q_m);
  return points_m;
}

/// A tool offset for which both models are valid, preferably one of A. If there is none, the first
/// tool offset of A.
calib::Vector3 common_tool_m(const calib::VolumetricModel& a, const calib::VolumetricModel& b) {
  for (const auto* model : {&a, &b})
    for (const calib::Vector3& tool_m : model->tool_offsets_m())
      if (a.holds_for_tool(tool_m) && b.holds_for_tool(tool_m)) return tool_m;
  return a.tool_offsets_m().front();
}

const CertifiedValue* value_named(const CertifiedValues& values, const std::string& key) {
  for (const ValueGroup& group : values.groups)
    for (const CertifiedValue& value : group.values)
      if (value.key == key) return &value;
  return nullptr;
}

/// Text with the value "B - A" and the U of the difference, for independent models; empty if one of
/// the values is missing.
std::string difference_text(const CertifiedValue& a, const CertifiedValue* b) {
  if (b == nullptr || a.value.empty() || b->value.empty()) return {};
  const double scale = a.is_angle ? kUradPerRad : kUmPerM;
  const double difference = scale * (b->value_si - a.value_si);
  if (a.U.empty()) return fmt::format("{:+.2f}", difference);
  return fmt::format("{:+.2f} \u00b1 {:.2f}", difference,
                     2.0 * scale * std::hypot(a.u_si, b->u_si));
}

void add_states(HtmlReport& page, const Sides& sides) {
  std::vector<std::vector<std::string>> rows;
  const auto row = [&](const char* what, auto text) {
    rows.push_back({what, text(sides.a), text(sides.b)});
  };
  row("model", [](const ReportSubject& s) { return model_id(s.document); });
  row("machine", [](const ReportSubject& s) { return s.document.machine; });
  row("verdict", [](const ReportSubject& s) { return verdict_in_words(s).text; });
  row("date (UTC)", [](const ReportSubject& s) { return when_in_words(s.document); });
  row("method", [](const ReportSubject& s) { return method_in_words(s.document); });
  row("datum",
      [](const ReportSubject& s) { return std::string{calib::name(s.document.model.datum())}; });
  row("tool offsets", [](const ReportSubject& s) { return tools_in_words(s.document.model); });
  page.table({"", "A", "B"}, rows);
  page.paragraph("A: " + box_in_words(sides.values_a.standard));
  page.paragraph("B: " + box_in_words(sides.values_b.standard));
}

void add_values_of_both(HtmlReport& page, const Sides& sides) {
  page.paragraph(
      "Values \u00b1 U (k = 2). The uncertainty of a difference holds if both models come from "
      "different measurements; what both have in common, for example the scale of the tracker, "
      "makes it smaller.");
  for (const ValueGroup& group : sides.values_a.groups) {
    page.heading(group.name);
    std::vector<std::vector<std::string>> rows;
    for (const CertifiedValue& a : group.values) {
      const CertifiedValue* b = value_named(sides.values_b, a.key);
      rows.push_back(
          {a.name, with_U(a), b == nullptr ? "not in B" : with_U(*b), difference_text(a, b)});
    }
    page.table({"", "A", "B", "B - A"}, rows);
  }
}

void add_curves_of_both(HtmlReport& page, const Sides& sides) {
  page.heading("Curves");
  for (const calib::Axis axis : calib::kAllAxes)
    page.plot(
        {.title = fmt::format("Positioning of {}", letter(axis)),
         .x_label = fmt::format("{}, mm", letter(axis)),
         .y_label = "um",
         .curves = {positioning_curve(sides.values_a.standard.positioning[index(axis)], "A"),
                    positioning_curve(sides.values_b.standard.positioning[index(axis)], "B")}});
  for (std::size_t d = 0; d < sides.values_a.standard.diagonals.size(); ++d)
    page.plot({.title = fmt::format("Diagonal {}", sides.values_a.standard.diagonals[d].name),
               .x_label = "along the diagonal, mm",
               .y_label = "um",
               .curves = {diagonal_curve(sides.values_a.standard.diagonals[d], "A"),
                          diagonal_curve(sides.values_b.standard.diagonals[d], "B")}});
}

}  // namespace

Result<std::string> comparison_report(const ReportSubject& a, const ReportSubject& b) {
  const auto points_m = nodes_of_both(a.document.model, b.document.model);
  const calib::Vector3 tool_m = common_tool_m(a.document.model, b.document.model);
  const auto difference =
      calib::rigid_free_difference(a.document.model, b.document.model, tool_m, points_m);
  if (!difference)
    return fail(ErrorCode::DataInsufficient,
                fmt::format("compare {} and {}: {}", model_id(a.document), model_id(b.document),
                            difference.error().text));
  auto values_a = certified_values(a.document);
  ABBE_TRY(values_a);
  auto values_b = certified_values(b.document);
  ABBE_TRY(values_b);
  const Sides sides{a, b, *std::move(values_a), *std::move(values_b)};

  HtmlReport page(fmt::format("{}: two models side by side", a.document.machine));
  add_states(page, sides);
  page.heading("Difference of V");
  const calib::Vector3 tool_mm = kMmPerM * tool_m;
  page.paragraph(fmt::format(
      "At {} nodes where both models are valid, for the tool offset {:.1f}, {:.1f}, {:.1f} mm. The "
      "values below are each for the first tool of its model.",
      points_m.size(), tool_mm.x(), tool_mm.y(), tool_mm.z()));
  const auto row = [](const char* what, const calib::VectorStatistics& s) {
    return std::vector<std::string>{what, um_text(s.mean_m), um_text(s.rms_m), um_text(s.max_m)};
  };
  page.table({"", "mean", "rms", "largest"},
             {row("as stated", difference->as_stated),
              row("without a rigid motion", difference->rigid_free)});
  add_values_of_both(page, sides);
  add_curves_of_both(page, sides);
  return page.text();
}

}  // namespace abbe::daemon
