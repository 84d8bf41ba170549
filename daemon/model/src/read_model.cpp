#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "abbe/base/bounded_json.hpp"
#include "abbe/base/text_file.hpp"
#include "abbe/base/utc_text.hpp"
#include "abbe/model/model_document.hpp"
#include "decimal.hpp"
#include "model_format.hpp"

namespace abbe::daemon {

namespace {

/// The largest array is the covariance of n parameters, n (n + 1) / 2 numbers; n = 20,000 fits.
/// to_json() writes five levels.
constexpr JsonBounds kModelBounds{
    .bytes = std::size_t{1} << 30, .depth = 16, .values = std::size_t{1} << 28};

/// long double: see decimal.hpp.
using Json = nlohmann::basic_json<std::map, std::vector, std::string, bool, std::int64_t,
                                  std::uint64_t, long double>;

/// Reads values by their path in the JSON text. For a value that cannot be read, a fault is added
/// and a default value is returned; the first 20 faults are kept.
class Reader {
 public:
  Reader(const Json& root, std::string file) : root_(root), file_(std::move(file)) {}

  void fault(std::string_view path, std::string_view what) {
    constexpr std::size_t kShown = 20;
    if (faults_.size() < kShown) faults_.push_back(fmt::format("{}: {}: {}", file_, path, what));
  }
  [[nodiscard]] bool any() const noexcept { return !faults_.empty(); }
  [[nodiscard]] Error to_error() const {
    return {ErrorCode::BadInput, fmt::format("{}: not a valid model", file_), faults_};
  }

  const Json* find(const Json& in, const std::string& path, const std::string& key) {
    if (in.is_object() && in.contains(key)) return &in.at(key);
    fault(path.empty() ? key : path + "." + key, "missing");
    return nullptr;
  }
  std::string text(const std::string& key) {
    const Json* value = find(root_, "", key);
    if (value == nullptr) return {};
    if (!value->is_string()) fault(key, "must be a string");
    return value->is_string() ? value->get<std::string>() : std::string{};
  }
  double number(const Json& value, const std::string& path, int shift) {
    if (!value.is_number()) {
      fault(path, "must be a number");
      return 0.0;
    }
    const double si = from_decimal(value.get<long double>(), shift);
    if (!std::isfinite(si)) fault(path, "out of range");
    return si;
  }
  double number_of(const Json& in, const std::string& path, const std::string& key, int shift) {
    const Json* value = find(in, path, key);
    return value == nullptr ? 0.0 : number(*value, path + "." + key, shift);
  }
  /// The number `key` of `in`, in SI. Adds a fault if it is not between `least` and `most`, both in
  /// SI.
  double number_within(const Json& in, const std::string& path, const std::string& key, int shift,
                       double least, double most) {
    const Json* value = find(in, path, key);
    if (value == nullptr) return least;
    const double si = number(*value, path + "." + key, shift);
    if (std::isfinite(si) && (si < least || si > most))
      fault(path + "." + key, fmt::format("is not plausible: {}", to_decimal(si, shift)));
    return si;
  }
  std::size_t count_of(const Json& in, const std::string& path, const std::string& key) {
    const Json* value = find(in, path, key);
    if (value == nullptr) return 0;
    if (!value->is_number_unsigned()) fault(path + "." + key, "must be a whole number");
    return value->is_number_unsigned() ? value->get<std::size_t>() : 0;
  }
  std::vector<double> numbers(const Json& value, const std::string& path, int shift) {
    std::vector<double> result;
    if (!value.is_array()) fault(path, "must be an array of numbers");
    if (value.is_array())
      for (const auto& element : value) result.push_back(number(element, path, shift));
    return result;
  }
  std::vector<calib::Vector3> vectors(const Json* value, const std::string& path) {
    std::vector<calib::Vector3> result;
    if (value == nullptr) return result;
    if (!value->is_array()) fault(path, "must be an array of [x, y, z]");
    if (value->is_array())
      for (const auto& element : *value) {
        const auto v = numbers(element, path, kMm);
        if (v.size() == 3)
          result.emplace_back(v[0], v[1], v[2]);
        else
          fault(path, "every element must be [x, y, z]");
      }
    return result;
  }
  [[nodiscard]] const Json& root() const noexcept { return root_; }

 private:
  const Json& root_;
  std::string file_;
  std::vector<std::string> faults_;
};

calib::Vector3 read_vector(Reader& in, const Json& entry, const std::string& path,
                           const std::string& key) {
  const Json* value = in.find(entry, path, key);
  if (value == nullptr) return calib::Vector3::Zero();
  const auto v = in.numbers(*value, path + "." + key, kMm);
  if (v.size() == 3) return {v[0], v[1], v[2]};
  in.fault(path + "." + key, "must be [x, y, z]");
  return calib::Vector3::Zero();
}

void read_polynomials(Reader& in, const Json& basis, calib::ModelDescription& out) {
  calib::PolynomialForm form;
  form.order = static_cast<int>(std::min<std::size_t>(in.count_of(basis, "basis", "order"), 1000));
  form.box.centre_m = read_vector(in, basis, "basis", "centre_mm");
  form.box.half_width_m = read_vector(in, basis, "basis", "half_width_mm");
  form.ball1_m = read_vector(in, basis, "basis", "zero_mm");
  out.polynomials = form;
}

void read_basis(Reader& in, calib::ModelDescription& out) {
  const Json* basis = in.find(in.root(), "", "basis");
  if (basis == nullptr) return;
  const Json* kind = in.find(*basis, "basis", "kind");
  if (kind != nullptr && *kind == kLegendre) return read_polynomials(in, *basis, out);
  const auto interpolation = kind != nullptr && kind->is_string()
                                 ? calib::estimation::table_interpolation(kind->get<std::string>())
                                 : std::nullopt;
  if (kind != nullptr && !interpolation)
    in.fault("basis.kind",
             fmt::format("is {}, must be \"{}\", \"{}\" or \"{}\"; another kind needs a newer abbe",
                         kind->dump(), calib::kLinearBasis, calib::kCubicBasis, kLegendre));
  out.interpolation = interpolation.value_or(out.interpolation);
  const Json* axes = in.find(*basis, "basis", "axes");
  if (axes == nullptr) return;

  for (const auto axis : calib::kAllAxes) {
    const auto path = fmt::format("basis.axes.{}", letter(axis));
    const Json* entry = in.find(*axes, "basis.axes", std::string(1, letter(axis)));
    if (entry == nullptr) continue;
    auto& nodes = out.nodes[index(axis)];
    if (const Json* list = in.find(*entry, path, "nodes_mm"))
      nodes.nodes_m = in.numbers(*list, path + ".nodes_mm", kMm);
    nodes.reference_m = in.number_of(*entry, path, "reference_mm", kMm);
  }
}

void read_parameters(Reader& in, calib::ModelDescription& out) {
  const Json* list = in.find(in.root(), "", "parameters");
  if (list == nullptr || !list->is_array()) return;
  for (std::size_t i = 0; i < list->size(); ++i) {
    const auto path = fmt::format("parameters[{}]", i);
    const Json& entry = (*list)[i];
    calib::Parameter p;
    const Json* name = in.find(entry, path, "name");
    if (name != nullptr && name->is_string()) p.name = name->get<std::string>();
    if (entry.contains("position_mm"))
      p.position_m = in.number(entry.at("position_mm"), path + ".position_mm", kMm);

    p.value = in.number_of(entry, path, "value", kMicroUnit);
    p.u = in.number_of(entry, path, "u", kMicroUnit);
    const Json* unit = in.find(entry, path, "unit");
    if (unit != nullptr && *unit != unit_of(p))
      in.fault(path + ".unit", fmt::format("must be \"{}\"", unit_of(p)));
    out.parameters.push_back(std::move(p));
  }
}

void read_covariance(Reader& in, calib::ModelDescription& out) {
  const Json* list = in.find(in.root(), "", "covariance");
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

void read_gauge(Reader& in, calib::ModelDescription& out) {
  const auto text = in.text("gauge");
  for (const auto gauge : {calib::Gauge::G1, calib::Gauge::Ball1Blocks, calib::Gauge::Ball1})
    if (text == name(gauge)) {
      out.gauge = gauge;
      return;
    }
  in.fault("gauge", "must be \"G1\", \"Ball1-blocks\" or \"Ball1\"");
}

calib::ModelDescription read_description(Reader& in) {
  calib::ModelDescription out;
  const auto chain = calib::KinematicChain::parse(in.text("chain"));
  if (chain)
    out.chain = *chain;
  else
    in.fault("chain", chain.error().text);
  read_gauge(in, out);
  if (in.text("squareness") != "travel") in.fault("squareness", "must be \"travel\"");
  out.tool_offsets_m = in.vectors(in.find(in.root(), "", "tool_offsets_mm"), "tool_offsets_mm");
  read_basis(in, out);
  if (const Json* validity = in.find(in.root(), "", "validity"))
    out.validity_hull_m = in.vectors(in.find(*validity, "validity", "hull_mm"), "validity.hull_mm");
  read_parameters(in, out);
  read_covariance(in, out);

  return out;
}

ResidualFigures read_residuals(Reader& in, const Json& statistics, const std::string& key) {
  const Json* figures = in.find(statistics, "statistics", key);
  if (figures == nullptr) return {};
  const auto path = "statistics." + key;
  return {in.number_of(*figures, path, "mae_um", kMicroUnit),
          in.number_of(*figures, path, "rms_um", kMicroUnit),
          in.number_of(*figures, path, "max_um", kMicroUnit)};
}

ModelStatistics read_statistics(Reader& in) {
  ModelStatistics s;
  const std::string path = "statistics";
  const Json* statistics = in.find(in.root(), "", path);
  if (statistics == nullptr) return s;
  s.samples = in.count_of(*statistics, path, "samples");
  s.lost_samples = in.count_of(*statistics, path, "lost_samples");
  s.observations = in.count_of(*statistics, path, "observations");
  s.unknowns = in.count_of(*statistics, path, "unknowns");
  s.rank = in.count_of(*statistics, path, "rank");
  s.condition = in.number_of(*statistics, path, "condition", 0);
  s.sigma0 = in.number_of(*statistics, path, "sigma0", 0);
  s.chi2_per_dof = in.number_of(*statistics, path, "chi2_per_dof", 0);
  s.variance_factor = in.number_of(*statistics, path, "covariance_factor", 0);
  s.before = read_residuals(in, *statistics, "before");
  s.after = read_residuals(in, *statistics, "after");
  s.iterations = static_cast<int>(in.count_of(*statistics, path, "iterations"));
  const Json* stop = in.find(*statistics, path, "stop_reason");
  if (stop != nullptr && stop->is_string()) s.stop_reason = stop->get<std::string>();

  return s;
}

// Limits of temperatures and expansion coefficients in model.json. They are wider than those of a
// sensor (-50 to 200 C), of [evemu], and of a calibrator file (+-50 um/(m K)), so that every model
// that abbe writes can be read.
constexpr double kLowest_K = 173.15, kHighest_K = 523.15;
constexpr double kMostAlpha_per_K = 100e-6;

std::optional<calib::Expansion> read_artefact(Reader& in) {
  const std::string path = "artefact";
  if (!in.root().is_object() || !in.root().contains(path)) return std::nullopt;
  const Json& artefact = in.root().at(path);
  const auto within = [&](const char* key, int shift, double least, double most) {
    return in.number_within(artefact, path, key, shift, least, most);
  };
  return calib::Expansion{
      within("alpha_um_per_m_K", kMicroUnit, -kMostAlpha_per_K, kMostAlpha_per_K),
      within("u_alpha_um_per_m_K", kMicroUnit, 0.0, kMostAlpha_per_K),
      within("temperature_K", 0, kLowest_K, kHighest_K),
      within("u_temperature_K", 0, 0.0, kHighest_K - kLowest_K)};
}

/// `recording_gap` is absent in models with a complete recording, `mode` in models of other
/// methods; both are absent in models of earlier versions.
std::string read_optional(Reader& in, const std::string& key) {
  return in.root().is_object() && in.root().contains(key) ? in.text(key) : std::string{};
}

/// Absent in models without backlash.
std::vector<calib::otf::Backlash> read_backlash(Reader& in) {
  std::vector<calib::otf::Backlash> all;
  const std::string path = "backlash";
  if (!in.root().is_object() || !in.root().contains(path)) return all;
  const Json& list = in.root().at(path);
  if (!list.is_array()) in.fault(path, "must be an array");

  for (std::size_t i = 0; list.is_array() && i < list.size(); ++i) {
    const std::string at = fmt::format("{}[{}]", path, i);
    const Json* name = in.find(list[i], at, "name");
    const auto motion = name != nullptr && name->is_string()
                            ? calib::error_motion(name->get<std::string>())
                            : std::nullopt;
    if (!motion) in.fault(at + ".name", "must be an error such as EXX");
    calib::otf::Backlash b{.motion = motion.value_or(calib::ErrorMotion{}),
                           .value = in.number_of(list[i], at, "value", kMicroUnit),
                           .u = in.number_of(list[i], at, "u", kMicroUnit),
                           .determined = true};
    if (list[i].is_object() && list[i].contains("position_mm"))
      b.position_m = in.number_of(list[i], at, "position_mm", kMm);
    all.push_back(b);
  }
  return all;
}

std::vector<InputFile> read_inputs(Reader& in) {
  std::vector<InputFile> inputs;
  const Json* list = in.find(in.root(), "", "inputs");
  if (list == nullptr || !list->is_array()) return inputs;
  for (const auto& entry : *list) {
    const Json* file = in.find(entry, "inputs", "file");
    const Json* hash = in.find(entry, "inputs", "sha256");
    if (file != nullptr && hash != nullptr && file->is_string() && hash->is_string())
      inputs.push_back({file->get<std::string>(), hash->get<std::string>()});
  }
  return inputs;
}

Result<ModelDocument> read_document(Reader& in) {
  if (in.text("schema") != kModelSchema) {
    in.fault("schema", fmt::format("must be \"{}\"", kModelSchema));
    // In a file with another schema all further faults would be meaningless, so only this one is
    // reported.
    return tl::make_unexpected(in.to_error());
  }

  const auto created = utc_from_text(in.text("created"));
  if (!created) in.fault("created", "must be a UTC time such as 2024-05-17T08:30:00.000000000Z");
  auto description = read_description(in);
  if (const auto valid = calib::check_covariance(description.covariance); !valid && !in.any())
    in.fault("covariance", valid.error().text);
  auto model = calib::VolumetricModel::from_description(std::move(description));
  if (!model && !in.any()) in.fault("parameters", model.error().text);
  const auto statistics = read_statistics(in);
  const auto inputs = read_inputs(in);
  const auto artefact = read_artefact(in);
  const auto backlash = read_backlash(in);
  const auto recording_gap = read_optional(in, "recording_gap"), mode = read_optional(in, "mode");
  const auto method = in.text("method"), estimator = in.text("estimator"),
             machine = in.text("machine"), machine_hash = in.text("machine_hash"),
             hash = in.text("hash");
  if (in.any()) return tl::make_unexpected(in.to_error());
  ModelDocument document{std::move(*model), method,        estimator,  machine,
                         machine_hash,      *created,      statistics, inputs,
                         artefact,          recording_gap, mode,       backlash};
  if (hash == model_hash(document)) return document;
  in.fault("hash", "is not the hash of the content: the file was changed or damaged");

  return tl::make_unexpected(in.to_error());
}

}  // namespace

Result<ModelDocument> parse_model(std::string_view text, const std::string& file) {
  if (auto within = check_json(text, file, kModelBounds); !within)
    return tl::make_unexpected(within.error());
  try {
    const auto root = Json::parse(text);
    Reader reader(root, file);
    return read_document(reader);
  } catch (const Json::exception& exception) {
    return fail(ErrorCode::BadInput, fmt::format("{}: {}", file, cause_of(exception)));
  }
}

Result<ModelDocument> read_model(const std::filesystem::path& file) {
  const auto text = read_text(file);
  if (!text) return tl::make_unexpected(text.error());
  return parse_model(*text, file.string());
}

}  // namespace abbe::daemon
