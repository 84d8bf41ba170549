#include "model_json.hpp"

#include <cmath>

#include "abbe/base/units.hpp"
#include "abbe/base/utc_text.hpp"
#include "abbe/calib/iso/standard_values.hpp"
#include "abbe/report/certified_values.hpp"
#include "abbe/report/model_figures.hpp"
#include "abbe/report/model_words.hpp"
#include "abbe/report/verdict_in_words.hpp"

namespace abbe::web {
namespace {

using calib::Vector3;
using daemon::kMmPerM;
using daemon::kUmPerM;
using nlohmann::json;

constexpr int kFieldPerSide = 6;  ///< places of the field along each side of the box

json vector_json(const Vector3& v, double scale) {
  return {scale * v.x(), scale * v.y(), scale * v.z()};
}

json charts_json(const calib::VolumetricModel& model) {
  json charts = json::array();
  for (const daemon::LineChart& chart : daemon::table_line_charts(model)) {
    json curves = json::array();
    for (const daemon::Curve& curve : chart.curves)
      curves.push_back({{"name", curve.name},
                        {"key", curve.key},
                        {"x", curve.x},
                        {"y", curve.y},
                        {"u", curve.u}});
    charts.push_back({{"title", chart.title},
                      {"x_label", chart.x_label},
                      {"y_label", chart.y_label},
                      {"curves", std::move(curves)}});
  }
  return charts;
}

/// V and its expanded uncertainty U = 2 sqrt(trace cov V) on a grid over the bounding box of the
/// validity volume, for the first tool; places outside the volume are left out.
json field_json(const calib::VolumetricModel& model) {
  const auto vertices = model.validity().vertices_m();
  if (vertices.empty() || model.tool_offsets_m().empty()) return nullptr;
  Vector3 low_m = vertices.front(), high_m = vertices.front();
  json hull = json::array();
  for (const Vector3& v : vertices) {
    low_m = low_m.cwiseMin(v);
    high_m = high_m.cwiseMax(v);
    hull.push_back(vector_json(v, kMmPerM));
  }

  const Vector3 step_m = (high_m - low_m) / (kFieldPerSide - 1.0);
  const Vector3 tool_m = model.tool_offsets_m().front();
  json vectors = json::array();
  constexpr int n = kFieldPerSide;
  for (int i = 0; i < n * n * n; ++i) {
    const Vector3 at_m = low_m + step_m.cwiseProduct(Vector3(i % n, i / n % n, i / n / n));
    const calib::VolumetricError error = model.error_at(at_m, tool_m, calib::AxisTravel{});
    if (!error.inside || !error.tool_ok) continue;
    vectors.push_back({{"at_mm", vector_json(at_m, kMmPerM)},
                       {"V_um", vector_json(error.V_m, kUmPerM)},
                       {"U_um", 2.0 * kUmPerM * std::sqrt(error.cov_V_m2.trace())}});
  }

  return {{"low_mm", vector_json(low_m, kMmPerM)},
          {"high_mm", vector_json(high_m, kMmPerM)},
          {"hull_mm", std::move(hull)},
          {"vectors", std::move(vectors)}};
}

json residuals_json(const daemon::ModelDocument& document) {
  const auto figures = [](const daemon::ResidualFigures& f) -> json {
    return {{"mean_um", kUmPerM * f.mean_abs_m},
            {"rms_um", kUmPerM * f.rms_m},
            {"max_um", kUmPerM * f.max_abs_m}};
  };
  json out{{"before", figures(document.statistics.before)},
           {"after", figures(document.statistics.after)}};
  if (!document.run) return out;

  const daemon::RunFigures& run = *document.run;
  out["held_out"] = {{"what", run.held_out},
                     {"before_um", kUmPerM * run.held_out_before_m},
                     {"after_um", kUmPerM * run.held_out_after_m}};
  json at = json::array(), before = json::array(), after = json::array();
  for (const auto& interval : run.residuals) {
    at.push_back(interval.at_m);
    before.push_back(kUmPerM * interval.before_m);
    after.push_back(kUmPerM * interval.after_m);
  }
  out["along_path"] = {{"at_m", at}, {"before_um", before}, {"after_um", after}};
  return out;
}

json verdict_json(const daemon::ReportSubject& subject) {
  const daemon::VerdictInWords verdict = daemon::verdict_in_words(subject);
  return {{"lamp", daemon::lamp_name(verdict.signal)},
          {"text", verdict.text},
          {"reasons", verdict.reasons},
          {"notes", verdict.notes}};
}

json values_json(const daemon::ModelDocument& document) {
  const auto values = daemon::certified_values(document);
  if (!values) return json::array();
  json groups = json::array();
  for (const daemon::ValueGroup& group : values->groups) {
    json rows = json::array();
    for (const daemon::CertifiedValue& v : group.values)
      rows.push_back({{"name", v.name},
                      {"value", v.value},
                      {"U", v.U},
                      {"unit", v.is_angle ? "urad" : "um"},
                      {"why", v.why}});
    groups.push_back(
        {{"name", group.name}, {"explanation", group.explanation}, {"values", std::move(rows)}});
  }
  return groups;
}

}  // namespace

json model_json(const daemon::ReportSubject& subject) {
  const daemon::ModelDocument& document = subject.document;
  const auto& s = document.statistics;
  json inputs = json::array();
  for (const auto& input : document.inputs)
    inputs.push_back({{"name", input.name}, {"sha256", input.sha256}});
  return {{"id", daemon::model_id(document)},
          {"machine", document.machine},
          {"method", daemon::method_in_words(document)},
          {"created", daemon::to_text(document.created)},
          {"chain", document.model.chain().text()},
          {"datum", daemon::datum_in_words(document.model)},
          {"tools", daemon::tools_in_words(document.model)},
          {"signs", daemon::signs_in_words()},
          {"observations", s.observations},
          {"unknowns", s.unknowns},
          {"rank", s.rank},
          {"condition", s.condition},
          {"sigma0", s.sigma0},
          {"inputs", std::move(inputs)},
          {"verdict", verdict_json(subject)},
          {"charts", charts_json(document.model)},
          {"field", field_json(document.model)},
          {"residuals", residuals_json(document)},
          {"values", values_json(document)},
          {"not_in_the_uncertainty", daemon::not_in_the_uncertainty(document)},
          {"not_estimable", daemon::not_estimable(document)}};
}

}  // namespace abbe::web
