#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>

#include "abbe/base/sha256.hpp"
#include "abbe/base/utc_text.hpp"
#include "abbe/calib/model/backlash.hpp"
#include "abbe/model/model_document.hpp"
#include "decimal.hpp"
#include "model_format.hpp"
#include "verdict_json.hpp"

namespace abbe::daemon {

namespace {

/// Composes the JSON text directly, so that numbers keep the digits of to_decimal(), each parameter
/// has one line, and the same document gives the same bytes.
class JsonText {
 public:
  void raw(std::string_view text) { text_ += text; }
  void key(std::string_view name) {
    text_ += fmt::format("{}\n  \"{}\": ", text_.size() > 1 ? "," : "", name);
  }
  void member(std::string_view name, std::string_view text) {
    key(name);
    text_ += quoted(text);
  }
  [[nodiscard]] static std::string quoted(std::string_view text) { return quoted_json(text); }
  [[nodiscard]] std::string finish() { return text_ + "\n}\n"; }

 private:
  std::string text_ = "{";
};

std::string vector_mm(const calib::Vector3& v) {
  return fmt::format("[{}, {}, {}]", to_decimal(v[0], kMm), to_decimal(v[1], kMm),
                     to_decimal(v[2], kMm));
}

std::string vectors_mm(std::span<const calib::Vector3> list) {
  std::string text = "[";
  for (const auto& v : list) text.append(text.size() > 1 ? ", " : "").append(vector_mm(v));
  return text + "]";
}

std::string numbers(std::span<const double> list, int shift) {
  std::string text = "[";
  for (const double v : list) text.append(text.size() > 1 ? ", " : "").append(to_decimal(v, shift));
  return text + "]";
}

void write_polynomials(JsonText& out, const calib::PolynomialModel& model) {
  const auto& design = model.design();
  out.key("basis");
  out.raw(
      fmt::format("{{\"kind\": \"{}\", \"order\": {},\n    \"centre_mm\": {}, \"half_width_mm\": "
                  "{}, \"zero_mm\": {}}}",
                  kLegendre, design.equivalent().order(), vector_mm(design.box().centre_m),
                  vector_mm(design.box().half_width_m), vector_mm(model.ball1_m())));
}

void write_axes(JsonText& out, const calib::VolumetricModel& model) {
  out.key("basis");
  out.raw(fmt::format("{{\"kind\": \"{}\", \"axes\": {{", basis_kind(model)));
  for (const auto axis : calib::kAllAxes) {
    const auto& nodes = stored_nodes(model)[index(axis)];
    out.raw(fmt::format("{}\n    \"{}\": {{\"nodes_mm\": {}, \"reference_mm\": {}}}",
                        index(axis) > 0 ? "," : "", letter(axis), numbers(nodes.nodes_m, kMm),
                        to_decimal(nodes.reference_m, kMm)));
  }
  out.raw("}}");
}

void write_parameters(JsonText& out, const calib::VolumetricModel& model) {
  out.key("parameters");
  out.raw("[");
  bool first = true;
  for (const auto& p : model.parameters()) {
    out.raw(fmt::format("{}\n    {{\"name\": \"{}\", ", first ? "" : ",", p.name));
    if (p.position_m) out.raw(fmt::format("\"position_mm\": {}, ", to_decimal(*p.position_m, kMm)));
    out.raw(fmt::format("\"value\": {}, \"u\": {}, \"unit\": \"{}\"}}",
                        to_decimal(p.value, kMicroUnit), to_decimal(p.u, kMicroUnit), unit_of(p)));
    first = false;
  }
  out.raw("\n  ]");
}

std::string differences(std::span<const calib::Backlash> list, std::string_view indent) {
  std::string text = "[";
  for (const auto& b : list) {
    text += fmt::format("{}\n{}  {{\"name\": \"{}\", ", text.size() > 1 ? "," : "", indent,
                        calib::name(b.motion));
    if (b.position_m) text += fmt::format("\"position_mm\": {}, ", to_decimal(*b.position_m, kMm));
    text +=
        fmt::format("\"value\": {}, \"u\": {}, \"unit\": \"{}\"}}", to_decimal(b.value, kMicroUnit),
                    to_decimal(b.u, kMicroUnit), unit_of(b.motion));
  }
  return fmt::format("{}\n{}]", text, indent);
}

void write_backlash(JsonText& out, std::span<const calib::Backlash> backlash) {
  out.key("backlash");
  out.raw(differences(backlash, "  "));
}

/// Writes the covariance row by row: covariances of a difference with the parameters, with itself
/// and with the differences after it.
void write_travel(JsonText& out, const calib::VolumetricModel& model) {
  const calib::TravelDifferences& d = *model.travel();
  out.key("travel");
  out.raw(fmt::format("{{\"kind\": \"{}\",\n    \"differences\": {},\n    \"covariance\": [",
                      calib::backlash_name(d.kind),
                      differences(calib::backlash_of(model), "    ")));

  for (Eigen::Index i = 0; i < d.D.size(); ++i) {
    std::string row;
    const auto add = [&row](double value) {
      row += (row.empty() ? "" : ",") + to_decimal(value, kMicroUnitSquared);
    };
    for (Eigen::Index j = 0; j < d.cov_U_D.rows(); ++j) add(d.cov_U_D(j, i));
    for (Eigen::Index j = i; j < d.D.size(); ++j) add(d.covariance(i, j));
    out.raw((i > 0 ? ",\n      " : "\n      ") + row);
  }
  out.raw("\n    ]}");
}

void write_covariance(JsonText& out, const Eigen::MatrixXd& covariance) {
  out.key("covariance");
  out.raw("[");
  for (Eigen::Index i = 0; i < covariance.rows(); ++i) {
    out.raw(i > 0 ? ",\n    " : "\n    ");
    for (Eigen::Index j = i; j < covariance.cols(); ++j) {
      if (j > i) out.raw(",");
      out.raw(to_decimal(covariance(i, j), kMicroUnitSquared));
    }
  }
  out.raw("\n  ]");
}

std::string residuals(const ResidualFigures& figures) {
  return fmt::format("{{\"mae_um\": {}, \"rms_um\": {}, \"max_um\": {}}}",
                     to_decimal(figures.mean_abs_m, kMicroUnit),
                     to_decimal(figures.rms_m, kMicroUnit),
                     to_decimal(figures.max_abs_m, kMicroUnit));
}

std::string vector_um(const calib::Vector3& v_m) {
  return numbers({v_m.data(), 3}, kMicroUnit);
}

/// A JSON array with one element per line.
template <class Elements, class Text>
std::string array_of(const Elements& elements, Text text) {
  std::string all = "[";
  for (const auto& element : elements)
    all += fmt::format("{}\n      {}", all.size() > 1 ? "," : "", text(element));
  return all + "]";
}

/// The members of "statistics" that only models of method mfb have.
std::string bar_figures(const BarFigures& bar) {
  const auto passes = array_of(bar.passes, [](const BarFigures::Pass& pass) {
    return fmt::format("{{\"name\": {}, \"chi2_per_dof\": {}}}", JsonText::quoted(pass.measurement),
                       to_decimal(pass.chi2_per_dof, 0));
  });
  const auto drift = array_of(bar.drift, [](const BarFigures::Drift& d) {
    return fmt::format("{{\"forward\": {}, \"backward\": {}, \"value\": {}, \"u\": {}}}",
                       JsonText::quoted(d.forward), JsonText::quoted(d.backward),
                       vector_um(d.rate_m), vector_um(d.u_rate_m));
  });
  const auto set_aside = array_of(bar.set_aside, [](const BarFigures::SetAside& t) {
    return fmt::format(
        "{{\"measurement\": {}, \"feature\": {}, \"index\": {}, \"side\": {}, \"k\": {}, "
        "\"residual_um\": {}}}",
        JsonText::quoted(t.measurement), JsonText::quoted(t.feature), t.index,
        JsonText::quoted(t.side), t.k, to_decimal(t.residual_m, kMicroUnit));
  });
  return fmt::format(
      ",\n    \"measurements\": {},\n    \"drift_um_per_pass\": {},\n    \"set_aside\": {}", passes,
      drift, set_aside);
}

void write_statistics(JsonText& out, const ModelStatistics& s,
                      const std::optional<BarFigures>& bar) {
  out.key("statistics");
  out.raw(fmt::format(
      "{{\"samples\": {}, \"lost_samples\": {}, \"observations\": {}, \"unknowns\": {}, \"rank\": "
      "{},\n"
      "    \"condition\": {}, \"sigma0\": {}, \"chi2_per_dof\": {}, \"variance_factor\": {},\n"
      "    \"before\": {},\n    \"after\": {},\n    \"iterations\": {}, \"stop_reason\": {}{}{}}}",
      s.samples, s.lost_samples, s.observations, s.unknowns, s.rank, to_decimal(s.condition, 0),
      to_decimal(s.sigma0, 0), to_decimal(s.chi2_per_dof, 0), to_decimal(s.variance_factor, 0),
      residuals(s.before), residuals(s.after), s.iterations, JsonText::quoted(s.stop_reason),
      s.degrees_of_freedom
          ? fmt::format(", \"degrees_of_freedom\": {}", to_decimal(*s.degrees_of_freedom, 0))
          : "",
      bar ? bar_figures(*bar) : ""));
}

std::string parts_of(const RunFigures& run) {
  const auto list = array_of(run.parts, [](const RunFigures::Part& p) {
    const std::string times =
        p.time_s ? fmt::format(", \"from_s\": {}, \"to_s\": {}", to_decimal((*p.time_s)[0], 0),
                               to_decimal((*p.time_s)[1], 0))
                 : std::string{};
    return fmt::format(
        "{{\"name\": {}, \"count\": {}, \"before_rms_um\": {}, \"after_rms_um\": {}, "
        "\"after_max_um\": {}{}}}",
        JsonText::quoted(p.name), p.count, to_decimal(p.before_rms_m, kMicroUnit),
        to_decimal(p.after_rms_m, kMicroUnit), to_decimal(p.after_max_m, kMicroUnit), times);
  });
  return fmt::format(",\n    \"part_kind\": {}, \"parts\": {}", JsonText::quoted(run.part_kind),
                     list);
}

std::string series_of(const RunFigures::Series& series) {
  const auto points = array_of(series.points, [](const RunFigures::Series::Point& p) {
    return fmt::format("[{}, {}]", to_decimal(p.at, 0), to_decimal(p.after_m, kMicroUnit));
  });
  return fmt::format(",\n    \"series\": {{\"count\": {}, \"over\": \"{}\", \"at_after_um\": {}}}",
                     series.count, series.over_time ? kOverTime : kOverNumber, points);
}

std::string cells_of(const RunFigures& run) {
  return array_of(run.held_out_cells, [](const RunFigures::HeldOutCell& c) {
    return fmt::format("[{}, {}, {}, {}, {}, {}]", c.slab, c.cell, c.count,
                       to_decimal(c.before_m, kMicroUnit), to_decimal(c.after_m, kMicroUnit),
                       to_decimal(c.sigma_m, kMicroUnit));
  });
}

std::string texts_of(const std::vector<std::string>& texts) {
  std::string all = "[";
  for (const std::string& text : texts)
    all.append(all.size() > 1 ? ", " : "").append(JsonText::quoted(text));
  return all + "]";
}

std::string tables_of(const RunFigures& run) {
  return array_of(run.tables, [](const RunFigures::Table& table) {
    return fmt::format("{{\"title\": {}, \"explanation\": {}, \"columns\": {}, \"rows\": {}}}",
                       JsonText::quoted(table.title), JsonText::quoted(table.explanation),
                       texts_of(table.columns), array_of(table.rows, texts_of));
  });
}

std::string conditions_of(const RunFigures::Conditions& c) {
  std::string all;
  const auto add = [&all](std::string_view key, const std::string& value) {
    all += fmt::format("{}\"{}\": {}", all.empty() ? "" : ", ", key, value);
  };
  if (c.temperature_K) add("temperature_K", numbers(*c.temperature_K, 0));
  if (c.bar_temperature_K) add("bar_temperature_K", numbers(*c.bar_temperature_K, 0));
  if (c.duration_s) add("duration_s", to_decimal(*c.duration_s, 0));
  if (c.feed_m_per_s) add("feed_mm_per_s", to_decimal(*c.feed_m_per_s, kMm));
  if (c.measured)
    add("measured_utc", texts_of({to_text((*c.measured)[0]), to_text((*c.measured)[1])}));
  return fmt::format(",\n    \"conditions\": {{{}}}", all);
}

/// The members of "run" that models of earlier versions do not have. A member without content is
/// left out, so that the text of such a model does not change.
std::string further_figures(const RunFigures& run) {
  std::string all;
  if (!run.parts.empty()) all += parts_of(run);
  if (run.series) all += series_of(*run.series);
  if (!run.sigma_counts.empty())
    all += fmt::format(",\n    \"sigma_counts\": [{}]", fmt::join(run.sigma_counts, ", "));
  if (!run.held_out_cells.empty())
    all += fmt::format(",\n    \"held_out_cells\": {}", cells_of(run));
  if (!run.tables.empty()) all += fmt::format(",\n    \"tables\": {}", tables_of(run));
  if (run.conditions) all += conditions_of(*run.conditions);
  if (!run.of_model.empty())
    all += fmt::format(",\n    \"of_model\": {}", JsonText::quoted(run.of_model));
  return all;
}

void write_run(JsonText& out, const RunFigures& run) {
  const auto notes = array_of(run.notes, [](const auto& note) { return JsonText::quoted(note); });
  const auto residuals = array_of(run.residuals, [](const RunFigures::Interval& i) {
    return fmt::format("[{}, {}, {}]", to_decimal(i.at_m, kMm), to_decimal(i.before_m, kMicroUnit),
                       to_decimal(i.after_m, kMicroUnit));
  });
  const auto places = array_of(run.places_m, [](const auto& line) { return vectors_mm(line); });
  out.key("run");
  out.raw(fmt::format(
      "{{\"held_out\": {}, \"held_out_before_um\": {}, \"held_out_after_um\": {},\n    \"notes\": "
      "{},\n    \"path_mm_before_um_after_um\": {},\n    \"places_mm\": {}{}}}",
      JsonText::quoted(run.held_out), to_decimal(run.held_out_before_m, kMicroUnit),
      to_decimal(run.held_out_after_m, kMicroUnit), notes, residuals, places,
      further_figures(run)));
}

void write_misfit(JsonText& out, const calib::Misfit& misfit) {
  std::string of_parameters;
  for (Eigen::Index i = 0; i < misfit.u_of_parameters.size(); ++i)
    of_parameters.append(i > 0 ? "," : "")
        .append(to_decimal(misfit.u_of_parameters[i], kMicroUnit));
  out.key("misfit");
  out.raw(
      fmt::format("{{\"u_V_um\": {}, \"V_length_mm\": {}, \"table_length_mm\": {},\n    "
                  "\"u_of_parameters\": [{}]}}",
                  vector_um(misfit.u_V_m), to_decimal(misfit.V_length_m, kMm),
                  to_decimal(misfit.table_length_m, kMm), of_parameters));
}

void write_tracker_place(JsonText& out, const calib::TrackerPlace& place) {
  std::string derivatives;
  for (Eigen::Index i = 0; i < place.range_offset.dU_dd.size(); ++i)
    derivatives.append(i > 0 ? "," : "").append(to_decimal(place.range_offset.dU_dd[i], 0));
  out.key("tracker_place");
  out.raw(
      fmt::format("{{\"name\": {}, \"range_offset_um\": {}, \"u_um\": {}, \"u_prior_um\": {},\n"
                  "    \"derivatives\": [{}]}}",
                  JsonText::quoted(place.name), to_decimal(place.range_offset.value_m, kMicroUnit),
                  to_decimal(place.range_offset.u_m, kMicroUnit),
                  to_decimal(place.range_offset.u_prior_m, kMicroUnit), derivatives));
}

void write_tracker_drift(JsonText& out, const TrackerDriftFigures& drift) {
  out.key("tracker_drift");
  out.raw(fmt::format("{{\"largest_um\": {}, \"nest_repeatability_um\": {}, \"visits\": {}}}",
                      vector_um(drift.largest_m), to_decimal(drift.u_repeatability_m, kMicroUnit),
                      drift.visits));
}

void write_artefact(JsonText& out, const calib::Expansion& artefact) {
  out.key("artefact");
  out.raw(fmt::format(
      "{{\"temperature_K\": {}, \"u_temperature_K\": {}, \"alpha_um_per_m_K\": {}, "
      "\"u_alpha_um_per_m_K\": {},\n"
      "    \"expansion_factor\": {}, \"u_expansion_factor\": {}}}",
      to_decimal(artefact.temperature_K, 0), to_decimal(artefact.u_temperature_K, 0),
      to_decimal(artefact.alpha_per_K, kMicroUnit), to_decimal(artefact.u_alpha_per_K, kMicroUnit),
      to_decimal(calib::expansion_factor(artefact), 0),
      to_decimal(calib::u_expansion_factor(artefact), 0)));
}

std::string entries_json(const MeaningEntries& entries) {
  std::string text;
  for (const auto& [key, value] : entries)
    text += fmt::format("{}\n      {}: {}", text.empty() ? "" : ",", JsonText::quoted(key),
                        JsonText::quoted(value));
  return text.empty() ? "{}" : "{" + text + "}";
}

void write_configuration(JsonText& out, const ModelDocument& document) {
  const auto simulated = made_on_simulated_devices(document);
  out.key("simulated");
  out.raw(!simulated ? "null" : *simulated ? "true" : "false");
  out.key("configuration");
  out.raw(fmt::format("{{\"readings\": {},\n    \"measurements\": {}}}",
                      entries_json(document.configuration->readings),
                      entries_json(document.configuration->measurements)));
}

void write_inputs(JsonText& out, const std::vector<InputFile>& inputs) {
  out.key("inputs");
  out.raw("[");
  for (std::size_t i = 0; i < inputs.size(); ++i)
    out.raw(fmt::format("{}\n    {{\"file\": {}, \"sha256\": {}}}", i > 0 ? "," : "",
                        JsonText::quoted(inputs[i].name), JsonText::quoted(inputs[i].sha256)));
  out.raw(inputs.empty() ? "]" : "\n  ]");
}

}  // namespace

std::string cannot_be_checked(std::string_view recording_gap) {
  return fmt::format("no replay can check this model: {}", recording_gap);
}

std::string to_json(const ModelDocument& document) {
  const auto& model = document.model;
  JsonText out;
  out.member("schema", kModelSchema);
  out.member("abbe_version", document.software.empty() ? kVersion : document.software);
  out.member("hash", model_hash(document));
  out.member("created", to_text(document.created));
  out.member("method", document.method);
  out.member("estimator", document.estimator);
  if (!document.mode.empty()) out.member("mode", document.mode);
  out.member("machine", document.machine);
  out.member("machine_hash", document.machine_hash);
  if (document.verdict) {
    out.key("verdict");
    out.raw(verdict_to_json(document));
  }
  if (document.configuration) write_configuration(out, document);
  out.member("chain", model.chain().text());
  out.member("datum", name(model.datum()));
  out.member("squareness", "travel");
  out.key("tool_offsets_mm");
  out.raw(vectors_mm(model.tool_offsets_m()));
  if (const auto* polynomials = model.polynomials())
    write_polynomials(out, *polynomials);
  else
    write_axes(out, model);
  write_statistics(out, document.statistics, document.bar);
  if (document.run) write_run(out, *document.run);
  if (document.tracker_drift) write_tracker_drift(out, *document.tracker_drift);
  if (document.artefact) write_artefact(out, *document.artefact);
  write_inputs(out, document.inputs);
  if (!document.recording_gap.empty()) out.member("recording_gap", document.recording_gap);
  out.key("validity");
  out.raw(fmt::format("{{\"hull_mm\": {}}}", vectors_mm(model.validity().vertices_m())));
  write_parameters(out, model);
  if (!document.backlash.empty()) write_backlash(out, document.backlash);
  if (model.travel() != nullptr) write_travel(out, model);
  if (model.misfit() != nullptr) write_misfit(out, *model.misfit());
  if (document.tracker_place) write_tracker_place(out, *document.tracker_place);
  write_covariance(out, model.covariance());

  return out.finish();
}

std::string to_coefficients_csv(const calib::PolynomialModel& model) {
  std::string text = "name,value,u,unit\n";
  for (const auto& c : model.named_coefficients())
    text += fmt::format("{},{:.17g},{:.17g},{}\n", c.name, c.value, c.u, c.unit);
  return text;
}

std::string to_tables_csv(const calib::VolumetricModel& model,
                          std::span<const calib::Backlash> backlash, Digits digits) {
  const auto number = [digits](double value, int shift) {
    return digits == Digits::All ? to_decimal(value, shift)
                                 : fmt::format("{:.6g}", value * std::pow(10.0, shift));
  };
  std::string text = "name,position_mm,value,u,unit\n";
  for (const auto& p : model.parameters())
    text += fmt::format("{},{},{},{},{}\n", p.name, p.position_m ? number(*p.position_m, kMm) : "",
                        number(p.value, kMicroUnit), number(p.u, kMicroUnit), unit_of(p));
  for (const auto& b : backlash)
    text += fmt::format("{}.backlash,{},{},{},{}\n", calib::name(b.motion),
                        b.position_m ? number(*b.position_m, kMm) : "", number(b.value, kMicroUnit),
                        number(b.u, kMicroUnit), unit_of(b.motion));
  return text;
}

}  // namespace abbe::daemon
