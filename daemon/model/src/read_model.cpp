#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "abbe/base/bounded_json.hpp"
#include "abbe/base/text_file.hpp"
#include "abbe/base/utc_text.hpp"
#include "abbe/model/model_document.hpp"
#include "abbe/result/try.hpp"
#include "model_reader.hpp"
#include "read_bar_figures.hpp"
#include "read_misfit.hpp"
#include "read_run_figures.hpp"
#include "read_tracker_place.hpp"
#include "read_travel.hpp"
#include "verdict_json.hpp"

namespace abbe::daemon {

namespace {

/// The largest array is the covariance of n parameters, n (n + 1) / 2 numbers; n = 20,000 fits.
/// to_json() writes five levels.
constexpr JsonBounds kModelBounds{
    .bytes = std::size_t{1} << 30, .depth = 16, .values = std::size_t{1} << 28};

calib::Vector3 read_vector(ModelReader& in, const ModelJson& entry, const std::string& path,
                           const std::string& key) {
  const ModelJson* value = in.find(entry, path, key);
  if (value == nullptr) return calib::Vector3::Zero();
  const auto v = in.numbers(*value, path + "." + key, kMm);
  if (v.size() == 3) return {v[0], v[1], v[2]};
  in.fault(path + "." + key, "must be [x, y, z]");
  return calib::Vector3::Zero();
}

void read_polynomials(ModelReader& in, const ModelJson& basis, calib::ModelDescription& out) {
  calib::PolynomialForm form;
  form.order = static_cast<int>(std::min<std::size_t>(in.count_of(basis, "basis", "order"), 1000));
  form.box.centre_m = read_vector(in, basis, "basis", "centre_mm");
  form.box.half_width_m = read_vector(in, basis, "basis", "half_width_mm");
  form.ball1_m = read_vector(in, basis, "basis", "zero_mm");
  out.polynomials = form;
}

void read_basis(ModelReader& in, calib::ModelDescription& out) {
  const ModelJson* basis = in.find(in.root(), "", "basis");
  if (basis == nullptr) return;
  const ModelJson* kind = in.find(*basis, "basis", "kind");
  if (kind != nullptr && *kind == kLegendre) return read_polynomials(in, *basis, out);
  const auto interpolation = kind != nullptr && kind->is_string()
                                 ? calib::table_interpolation(kind->get<std::string>())
                                 : std::nullopt;
  if (kind != nullptr && !interpolation)
    in.fault(
        "basis.kind",
        fmt::format("is {}, must be \"{}\", \"{}\", \"{}\" or \"{}\"; another kind needs a newer "
                    "abbe",
                    kind->dump(), calib::kLinearBasis, calib::kCubicBasis,
                    calib::kNotAKnotCubicBasis, kLegendre));
  out.interpolation = interpolation.value_or(out.interpolation);
  const ModelJson* axes = in.find(*basis, "basis", "axes");
  if (axes == nullptr) return;

  for (const auto axis : calib::kAllAxes) {
    const auto path = fmt::format("basis.axes.{}", letter(axis));
    const ModelJson* entry = in.find(*axes, "basis.axes", std::string(1, letter(axis)));
    if (entry == nullptr) continue;
    auto& nodes = out.nodes[index(axis)];
    if (const ModelJson* list = in.find(*entry, path, "nodes_mm"))
      nodes.nodes_m = in.numbers(*list, path + ".nodes_mm", kMm);
    nodes.reference_m = in.number_of(*entry, path, "reference_mm", kMm);
  }
}

void read_parameters(ModelReader& in, calib::ModelDescription& out) {
  const ModelJson* list = in.find(in.root(), "", "parameters");
  if (list == nullptr || !list->is_array()) return;
  for (std::size_t i = 0; i < list->size(); ++i) {
    const auto path = fmt::format("parameters[{}]", i);
    const ModelJson& entry = (*list)[i];
    calib::Parameter p;
    const ModelJson* name = in.find(entry, path, "name");
    if (name != nullptr && name->is_string()) p.name = name->get<std::string>();
    if (entry.contains("position_mm"))
      p.position_m = in.number(entry.at("position_mm"), path + ".position_mm", kMm);

    p.value = in.number_of(entry, path, "value", kMicroUnit);
    p.u = in.number_of(entry, path, "u", kMicroUnit);
    const ModelJson* unit = in.find(entry, path, "unit");
    if (unit != nullptr && *unit != unit_of(p))
      in.fault(path + ".unit", fmt::format("must be \"{}\"", unit_of(p)));
    out.parameters.push_back(std::move(p));
  }
}

void read_covariance(ModelReader& in, calib::ModelDescription& out) {
  const ModelJson* list = in.find(in.root(), "", "covariance");
  if (list == nullptr) return;
  const auto n = static_cast<Eigen::Index>(out.parameters.size());
  const auto values = in.numbers(*list, "covariance", kMicroUnitSquared);

  if (values.size() != static_cast<std::size_t>(n * (n + 1) / 2)) {
    in.fault("covariance", fmt::format("{} values, expected {}", values.size(), n * (n + 1) / 2));
    return;
  }

  out.covariance.resize(n, n);
  std::size_t k = 0;
  for (Eigen::Index i = 0; i < n; ++i)
    for (Eigen::Index j = i; j < n; ++j) out.covariance(i, j) = out.covariance(j, i) = values[k++];
}

void read_datum(ModelReader& in, calib::ModelDescription& out) {
  // earlier versions wrote the key "gauge"
  const std::string key = in.has("gauge") ? "gauge" : "datum";
  const auto text = in.text(key);
  for (const auto datum : {calib::ModelDatum::G1, calib::ModelDatum::G2,
                           calib::ModelDatum::Ball1Blocks, calib::ModelDatum::Ball1})
    if (text == name(datum)) {
      out.datum = datum;
      return;
    }
  in.fault(key, "must be \"G1\", \"G2\", \"Ball1-blocks\" or \"Ball1\"");
}

calib::ModelDescription read_description(ModelReader& in) {
  calib::ModelDescription out;
  const auto chain = calib::KinematicChain::parse(in.text("chain"));
  if (chain)
    out.chain = *chain;
  else
    in.fault("chain", chain.error().text);
  read_datum(in, out);
  if (in.text("squareness") != "travel") in.fault("squareness", "must be \"travel\"");
  out.tool_offsets_m = in.vectors(in.find(in.root(), "", "tool_offsets_mm"), "tool_offsets_mm");
  read_basis(in, out);
  if (const ModelJson* validity = in.find(in.root(), "", "validity"))
    out.validity_hull_m = in.vectors(in.find(*validity, "validity", "hull_mm"), "validity.hull_mm");
  read_parameters(in, out);
  read_covariance(in, out);

  return out;
}

ResidualFigures read_residuals(ModelReader& in, const ModelJson& statistics,
                               const std::string& key) {
  const ModelJson* figures = in.find(statistics, "statistics", key);
  if (figures == nullptr) return {};
  const auto path = "statistics." + key;
  return {in.number_of(*figures, path, "mae_um", kMicroUnit),
          in.number_of(*figures, path, "rms_um", kMicroUnit),
          in.number_of(*figures, path, "max_um", kMicroUnit)};
}

ModelStatistics read_statistics(ModelReader& in) {
  ModelStatistics s;
  const std::string path = "statistics";
  const ModelJson* statistics = in.find(in.root(), "", path);
  if (statistics == nullptr) return s;
  s.samples = in.count_of(*statistics, path, "samples");
  s.lost_samples = in.count_of(*statistics, path, "lost_samples");
  s.observations = in.count_of(*statistics, path, "observations");
  s.unknowns = in.count_of(*statistics, path, "unknowns");
  s.rank = in.count_of(*statistics, path, "rank");
  s.condition = in.number_of(*statistics, path, "condition", 0);
  s.sigma0 = in.number_of(*statistics, path, "sigma0", 0);
  s.chi2_per_dof = in.number_of(*statistics, path, "chi2_per_dof", 0);
  // earlier versions wrote the key "covariance_factor"
  const bool earlier = statistics->is_object() && statistics->contains("covariance_factor");
  s.variance_factor =
      in.number_of(*statistics, path, earlier ? "covariance_factor" : "variance_factor", 0);
  s.before = read_residuals(in, *statistics, "before");
  s.after = read_residuals(in, *statistics, "after");
  s.iterations = static_cast<int>(in.count_of(*statistics, path, "iterations"));
  if (statistics->is_object() && statistics->contains("degrees_of_freedom"))
    s.degrees_of_freedom = in.number_of(*statistics, path, "degrees_of_freedom", 0);
  const ModelJson* stop = in.find(*statistics, path, "stop_reason");
  if (stop != nullptr && stop->is_string()) s.stop_reason = stop->get<std::string>();

  return s;
}

// Limits of temperatures and expansion coefficients in model.json. They are wider than those of a
// sensor (-50 to 200 C), of [evemu], and of a calibrator file (+-50 um/(m K)), so that every model
// that abbe writes can be read.
constexpr double kLowest_K = 173.15, kHighest_K = 523.15;
constexpr double kMostAlpha_per_K = 100e-6;

std::optional<calib::Expansion> read_artefact(ModelReader& in) {
  const std::string path = "artefact";
  if (!in.root().is_object() || !in.root().contains(path)) return std::nullopt;
  const ModelJson& artefact = in.root().at(path);
  const auto within = [&](const char* key, int shift, double least, double most) {
    return in.number_within(artefact, path, key, shift, least, most);
  };
  return calib::Expansion{
      within("alpha_um_per_m_K", kMicroUnit, -kMostAlpha_per_K, kMostAlpha_per_K),
      within("u_alpha_um_per_m_K", kMicroUnit, 0.0, kMostAlpha_per_K),
      within("temperature_K", 0, kLowest_K, kHighest_K),
      within("u_temperature_K", 0, 0.0, kHighest_K - kLowest_K)};
}

/// Reads an optional text. `recording_gap` is absent in models with a complete recording, `mode` in
/// models of other methods; both are absent in models of earlier versions.
std::string read_optional(ModelReader& in, const std::string& key) {
  return in.root().is_object() && in.root().contains(key) ? in.text(key) : std::string{};
}

/// Reads the drift of the tracker; nullopt in models without reference nests.
std::optional<TrackerDriftFigures> read_tracker_drift(ModelReader& in) {
  const std::string path = "tracker_drift";
  if (!in.root().is_object() || !in.root().contains(path)) return std::nullopt;
  const ModelJson& entry = in.root().at(path);
  return TrackerDriftFigures{
      .largest_m = in.vector_um(entry, path, "largest_um"),
      .u_repeatability_m = in.number_of(entry, path, "nest_repeatability_um", kMicroUnit),
      .visits = in.count_of(entry, path, "visits")};
}

std::vector<InputFile> read_inputs(ModelReader& in) {
  std::vector<InputFile> inputs;
  const ModelJson* list = in.find(in.root(), "", "inputs");
  if (list == nullptr || !list->is_array()) return inputs;
  for (const auto& entry : *list) {
    const ModelJson* file = in.find(entry, "inputs", "file");
    const ModelJson* hash = in.find(entry, "inputs", "sha256");
    if (file != nullptr && hash != nullptr && file->is_string() && hash->is_string())
      inputs.push_back({file->get<std::string>(), hash->get<std::string>()});
  }
  return inputs;
}

MeaningEntries read_entries(ModelReader& in, const ModelJson& configuration,
                            const std::string& key) {
  MeaningEntries entries;
  const ModelJson* list = in.find(configuration, "configuration", key);
  if (list == nullptr || !list->is_object()) return entries;
  for (const auto& [name, value] : list->items()) {
    if (value.is_string())
      set_entry(entries, name, value.get<std::string>());
    else
      in.fault(fmt::format("configuration.{}.{}", key, name), "must be a string");
  }
  return entries;
}

/// Reads the configuration; nullopt in models of earlier versions.
std::optional<Meaning> read_configuration(ModelReader& in) {
  if (!in.root().is_object() || !in.root().contains("configuration")) return std::nullopt;
  const ModelJson& entry = in.root().at("configuration");
  return Meaning{read_entries(in, entry, "readings"), read_entries(in, entry, "measurements")};
}

void check_configuration(ModelReader& in, const ModelDocument& document) {
  if (!document.configuration) return;
  if (hash_of(document.configuration->readings) != document.machine_hash)
    in.fault("configuration.readings",
             "machine_hash is not their hash: the file was changed or damaged");
  const auto simulated = made_on_simulated_devices(document);
  const ModelJson stated = simulated ? ModelJson(*simulated) : ModelJson();
  if (!in.root().contains("simulated") || in.root().at("simulated") != stated)
    in.fault("simulated", "differs from the configuration: the file was changed or damaged");
}

Result<ModelDocument> read_document(ModelReader& in) {
  if (in.text("schema") != kModelSchema) {
    in.fault("schema", fmt::format("must be \"{}\"", kModelSchema));
    // If the file has another schema, further faults would have no meaning; only this one is
    // reported.
    return tl::make_unexpected(in.to_error());
  }

  const auto created = utc_from_text(in.text("created"));
  if (!created) in.fault("created", "must be a UTC time such as 2024-05-17T08:30:00.000000000Z");
  auto description = read_description(in);
  if (const auto valid = calib::check_covariance(description.covariance); !valid && !in.any())
    in.fault("covariance", valid.error().text);
  const auto travel = read_travel(in, description.parameters.size());
  if (travel) description.travel = travel->differences;
  description.misfit = read_misfit(in);
  const auto tracker_place = read_tracker_place(in, description.parameters.size());
  const bool has_misfit = description.misfit.has_value();
  auto model = calib::VolumetricModel::from_description(std::move(description));
  if (!model && !in.any())
    in.fault(
        fmt::format("parameters{}{}", travel ? " or travel" : "", has_misfit ? " or misfit" : ""),
        model.error().text);
  if (model && travel) check_names(in, *travel, *model);
  const auto statistics = read_statistics(in);
  const auto inputs = read_inputs(in);
  const auto artefact = read_artefact(in);
  const auto backlash = read_backlash(in);
  const auto tracker_drift = read_tracker_drift(in);
  const auto bar = read_bar_figures(in);
  const auto run = read_run_figures(in);
  const auto verdict = read_verdict(in);
  const auto configuration = read_configuration(in);
  const auto recording_gap = read_optional(in, "recording_gap"), mode = read_optional(in, "mode"),
             software = read_optional(in, "abbe_version");
  const auto method = in.text("method"), estimator = in.text("estimator"),
             machine = in.text("machine"), machine_hash = in.text("machine_hash"),
             hash = in.text("hash");
  if (in.any()) return tl::make_unexpected(in.to_error());
  ModelDocument document{std::move(*model), method,        estimator,    machine,
                         machine_hash,      *created,      statistics,   inputs,
                         artefact,          recording_gap, mode,         backlash,
                         tracker_drift,     bar,           run,          software,
                         verdict,           configuration, tracker_place};
  check_configuration(in, document);
  if (hash != model_hash(document))
    in.fault("hash", "is not the hash of the content: the file was changed or damaged");
  else if (!verdict_is_whole(in, document))
    in.fault("verdict", "is not the verdict on this model: the file was changed or damaged");
  if (!in.any()) return document;

  return tl::make_unexpected(in.to_error());
}

}  // namespace

Result<ModelDocument> parse_model(std::string_view text, const std::string& file) {
  ABBE_TRY(check_json(text, file, kModelBounds));
  try {
    const auto root = ModelJson::parse(text);
    ModelReader reader(root, file);
    return read_document(reader);
  } catch (const ModelJson::exception& exception) {
    return fail(ErrorCode::BadInput, fmt::format("{}: {}", file, cause_of(exception)));
  }
}

Result<ModelDocument> read_model(const std::filesystem::path& file) {
  const auto text = read_text(file);
  ABBE_TRY(text);
  return parse_model(*text, file.string());
}

}  // namespace abbe::daemon
