#include "abbe/tasks/verify.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "abbe/base/units.hpp"
#include "abbe/calib/fit/points_off.hpp"
#include "abbe/config/calib_error.hpp"
#include "abbe/report/calibration_certificate.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tasks/forced_use.hpp"
#include "abbe/tasks/vector_option.hpp"
#include "certificate_file.hpp"
#include "verify_points.hpp"

namespace abbe::daemon {
namespace {

namespace verify = calib::verify;

/// Usage for an argument that has no effect with several models. With `live`, `out` is the folder
/// of the measured points.
Result<void> check_several(const VerifyArguments& arguments) {
  const auto only_one = [](std::string_view name) -> Result<void> {
    return fail(ErrorCode::Usage, fmt::format("verify: {} is for one model; give one", name));
  };
  if (!arguments.out.empty() && !arguments.live) return only_one("-o (report.html, grid.csv)");
  if (!arguments.origin.empty()) return only_one("--origin-mm");
  if (!arguments.grid.empty()) return only_one("--grid-mm");
  if (!arguments.planes.empty()) return only_one("--planes-mm");
  if (arguments.least_distance_mm) return only_one("--least-distance-mm");
  if (!arguments.details.empty()) return only_one("--details");
  return {};
}

/// Usage unless there is a model and exactly one source of points. Points of the running machine
/// also need a folder in which they are kept.
Result<void> check_verify(const VerifyArguments& arguments) {
  if (arguments.models.empty()) return fail(ErrorCode::Usage, "verify: give a model");
  const int given =
      !arguments.points.empty() + !arguments.recording.empty() + (arguments.live ? 1 : 0);
  if (given != 1) return fail(ErrorCode::Usage, "verify: give --points, --recording or --live");
  if (arguments.live && arguments.out.empty())
    return fail(ErrorCode::Usage, "verify --live: -o is required: the points are saved there");
  return arguments.models.size() > 1 ? check_several(arguments) : Result<void>{};
}

Result<verify::Options> options_of(const VerifyArguments& arguments) {
  verify::Options options;
  if (!arguments.origin.empty()) {
    const auto origin = parse_mm("--origin-mm", arguments.origin);
    ABBE_TRY(origin);
    options.origin_m = *origin;
  }

  if (!arguments.grid.empty()) {
    const auto step = parse_mm("--grid-mm", arguments.grid);
    ABBE_TRY(step);
    if (!(step->minCoeff() > 0.0))
      return fail(ErrorCode::Usage,
                  fmt::format("--grid-mm \"{}\": must be positive", arguments.grid));
    options.step_m = *step;
  }

  if (arguments.least_distance_mm)
    options.least_distance_m = *arguments.least_distance_mm / kMmPerM;
  return options;
}

/// Usage if the tool offsets of the models differ, because the points were measured with one tool
/// offset.
Result<void> check_tools(const std::vector<ModelAtPoints>& models) {
  constexpr double kSameTool_m = 1e-6;
  const auto& first = models.front();
  const auto other = std::ranges::find_if(models, [&](const ModelAtPoints& one) {
    return (one.tool_m - first.tool_m).norm() > kSameTool_m;
  });
  if (other == models.end()) return {};
  return fail(ErrorCode::Usage,
              fmt::format("{} and {} have different tool offsets. State with --tool-mm the tool "
                          "offset with which the points were measured",
                          first.model.name, other->model.name));
}

Result<std::vector<ModelAtPoints>> models_of(const VerifyArguments& arguments) {
  std::vector<ModelAtPoints> models;
  for (const std::string& name : arguments.models) {
    auto model = compared_model(name, arguments.store);
    ABBE_TRY(model);
    const auto tool_m = tool_of(arguments.tool, model->document.model);
    ABBE_TRY(tool_m);
    models.push_back({std::move(*model), *tool_m});
  }
  ABBE_TRY(check_tools(models));
  return models;
}

/// V of a model where the model is valid; `one` must outlive the result.
verify::ErrorsAt errors_of(const ModelAtPoints& one) {
  return [&one](const calib::Vector3& reading_m) -> std::optional<calib::Vector3> {
    const auto& model = one.model.document.model;
    if (!model.holds_for_tool(one.tool_m) || !model.validity().contains(reading_m))
      return std::nullopt;
    return model.V_at(reading_m, one.tool_m);
  };
}

/// Single shots that do not fit the model, at places inside the validity volume.
std::vector<std::string> off_with_model(const VerificationFile& file,
                                        const verify::Observations& observed,
                                        const ModelAtPoints& one) {
  std::vector<calib::Vector3> measured_m, corrected_m;
  std::vector<std::size_t> shots;
  for (const std::size_t place : one.comparison.inside)
    shots.insert(shots.end(), observed.shots[place].begin(), observed.shots[place].end());
  std::ranges::sort(shots);
  for (const std::size_t shot : shots) {
    const auto& [reading_m, at_m] = file.points[shot];
    measured_m.push_back(at_m);
    corrected_m.emplace_back(reading_m + one.model.document.model.V_at(reading_m, one.tool_m));
  }
  // An error as large as the errors of the machine may be an error that the model does not know;
  // such points are not listed.
  auto off = calib::fit::points_off(measured_m, corrected_m, one.comparison.before.rms_m);
  for (auto& found : off.points) found.point = shots[found.point];
  return lines_of_points_off(
      file, off, "check or repeat this point; if it is right, the model is wrong there");
}

/// `error`, completed by the usual mistakes that may explain it.
Error with_mistakes(Error error, const std::vector<std::string>& mistakes) {
  for (const std::string& text : mistakes) error.details.push_back("they fit with " + text);
  return error;
}

/// The details in the file of option --details; empty if it is not given. BadInput for an
/// impossible date.
Result<CertificateDetails> details_of(const VerifyArguments& arguments) {
  if (arguments.details.empty()) return CertificateDetails{};
  auto details = read_certificate_toml(arguments.details);
  ABBE_TRY(details);
  details->now = actor_now({}).when;
  auto wrong = wrong_verification_dates(*details);
  if (wrong.empty()) return details;
  return tl::make_unexpected(
      Error{ErrorCode::BadInput, arguments.details + ": dates are impossible", std::move(wrong)});
}

/// Compares one model, also on the grid.
Result<void> compare_one(Verification& v, const VerificationFile& file,
                         const verify::Options& options) {
  ModelAtPoints& one = v.models.front();
  v.likely_mistakes = verify::likely_mistakes(file.points, v.observations.frame, errors_of(one));
  auto compared = verify::compare(v.observations, one.model.document.model, one.tool_m, options);
  if (!compared)
    return tl::make_unexpected(with_mistakes(error_of(compared.error()), v.likely_mistakes));
  one.comparison = std::move(*compared);
  v.inside = one.comparison.inside.size();
  v.points_off = off_with_model(file, v.observations, one);
  if (!v.different_machines.empty()) one.model.cautions.push_back(v.different_machines);
  return {};
}

/// The observations at places at which all models are valid, so that all models are compared at the
/// same places.
verify::Observations inside_all(const verify::Observations& all,
                                const std::vector<ModelAtPoints>& models) {
  verify::Observations common;
  common.frame = all.frame;
  common.T_machine_tracker = all.T_machine_tracker;
  common.repeatability_m = all.repeatability_m;
  for (std::size_t i = 0; i < all.readings_m.size(); ++i) {
    const bool inside = std::ranges::all_of(models, [&](const ModelAtPoints& one) {
      return one.model.document.model.validity().contains(all.readings_m[i]);
    });
    if (!inside) continue;
    common.readings_m.push_back(all.readings_m[i]);
    common.measured_m.push_back(all.measured_m[i]);
    common.V_m.push_back(all.V_m[i]);
    common.shots.push_back(all.shots[i]);
  }
  return common;
}

/// Compares several models at the places where all of them are valid.
Result<void> compare_each(Verification& v) {
  const auto common = inside_all(v.observations, v.models);
  v.inside = common.shots.size();
  for (auto& [model, tool_m, comparison] : v.models) {
    auto compared = verify::compare_at_points(common, model.document.model, tool_m);
    if (!compared) {
      const auto error = error_of(compared.error());
      return fail(error.code, fmt::format("{}: {}", model.name, error.text));
    }
    comparison = std::move(*compared);
  }
  return {};
}

}  // namespace

Result<Verification> verify_models(const VerifyArguments& arguments,
                                   std::optional<Error>& cut_short, const Progress& progress) {
  ABBE_TRY(check_verify(arguments));
  const auto options = options_of(arguments);
  ABBE_TRY(options);
  auto models = models_of(arguments);
  ABBE_TRY(models);
  Verification v{.models = std::move(*models)};
  auto details = details_of(arguments);
  ABBE_TRY(details);
  v.details = *std::move(details);
  if (!arguments.planes.empty()) {
    const auto planes = parse_mm("--planes-mm", arguments.planes);
    ABBE_TRY(planes);
    v.planes_m = *planes;
  }

  const auto points = points_for(v, arguments, progress);
  ABBE_TRY(points);
  cut_short = points->cut_short;
  auto observed = observed_in(arguments, points->file, errors_of(v.models.front()));
  ABBE_TRY(observed);
  v.observations = std::move(*observed);
  ABBE_TRY(v.models.size() > 1 ? compare_each(v) : compare_one(v, points->file, *options));
  return v;
}

}  // namespace abbe::daemon
