#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "abbe/config/calib_error.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tasks/vector_option.hpp"
#include "abbe/tasks/verify.hpp"
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
  return {};
}

/// Usage if the tool offsets differ: the points were measured with one.
Result<void> check_tools(const std::vector<ModelAtPoints>& models) {
  constexpr double kSameTool_m = 1e-6;
  const auto& first = models.front();
  const auto other = std::ranges::find_if(models, [&](const ModelAtPoints& one) {
    return (one.tool_m - first.tool_m).norm() > kSameTool_m;
  });
  if (other == models.end()) return {};
  return fail(ErrorCode::Usage,
              fmt::format("{} and {} have different tool offsets, the points were measured with "
                          "one: give it with --tool",
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

/// The places at which all models are valid: the models are compared at the same places.
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

Result<void> compare_each(std::vector<ModelAtPoints>& models, const verify::Observations& common) {
  for (auto& [model, tool_m, comparison] : models) {
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

Result<SeveralOutcome> verify_several(const VerifyArguments& arguments,
                                      std::optional<Error>& cut_short, const Progress& progress) {
  ABBE_TRY(check_verify(arguments));
  ABBE_TRY(check_several(arguments));
  auto models = models_of(arguments);
  ABBE_TRY(models);
  std::vector<OfMachine> machines;
  for (const auto& one : *models) machines.push_back({one.model.name, one.model.machine});

  SeveralOutcome outcome;
  auto points = points_of(arguments, std::move(machines), outcome.different_machines, progress);
  ABBE_TRY(points);
  auto observed = observed_in(arguments, points->file);
  ABBE_TRY(observed);
  cut_short = std::move(points->cut_short);

  const verify::Observations common = inside_all(*observed, *models);
  ABBE_TRY(compare_each(*models, common));
  outcome.models = std::move(*models);
  outcome.observations = std::move(*observed);
  outcome.inside_all = common.shots.size();
  return outcome;
}

}  // namespace abbe::daemon
