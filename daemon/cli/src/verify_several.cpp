#include "verify_several.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "abbe/base/exit_codes.hpp"
#include "abbe/base/json_text.hpp"
#include "abbe/base/printable.hpp"
#include "abbe/base/units.hpp"
#include "abbe/calib/verify/compare.hpp"
#include "abbe/config/calib_error.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tasks/effect_name.hpp"
#include "abbe/tasks/vector_option.hpp"
#include "abbe/tasks/verification_report.hpp"
#include "figures.hpp"
#include "same_machine.hpp"

namespace abbe::daemon {
namespace {

namespace verify = calib::verify;

/// The places at which all models are valid: the models are compared at the same places.
verify::Observations inside_all(const verify::Observations& all,
                                const std::vector<NamedModel>& models) {
  verify::Observations common;
  common.frame = all.frame;
  common.T_machine_tracker = all.T_machine_tracker;
  common.repeatability_m = all.repeatability_m;
  for (std::size_t i = 0; i < all.readings_m.size(); ++i) {
    const bool inside = std::ranges::all_of(models, [&](const NamedModel& model) {
      return model.document.model.validity().contains(all.readings_m[i]);
    });
    if (!inside) continue;
    common.readings_m.push_back(all.readings_m[i]);
    common.measured_m.push_back(all.measured_m[i]);
    common.V_m.push_back(all.V_m[i]);
    common.shots.push_back(all.shots[i]);
  }
  return common;
}

struct Predicted {
  const NamedModel* model;
  verify::Comparison at_points;
};

Result<std::vector<Predicted>> predictions(const std::vector<NamedModel>& models,
                                           const verify::Observations& common) {
  std::vector<Predicted> all;
  for (const NamedModel& model : models) {
    auto compared = verify::compare_at_points(common, model.document.model, model.tool_m);
    if (!compared) {
      const auto error = error_of(compared.error());
      return fail(error.code, fmt::format("{}: {}", model.name, error.text));
    }
    all.push_back({&model, std::move(*compared)});
  }
  return all;
}

void print_predictions_json(const std::vector<Predicted>& all, const verify::Observations& observed,
                            const verify::Observations& common,
                            const std::string& different_machines) {
  nlohmann::json object{{"points", observed.shot_count()},
                        {"places", observed.shots.size()},
                        {"inside_all", common.shots.size()},
                        {"repeatability_um", repeatability_figure(observed)},
                        {"different_machines", different_machines},
                        {"models", nlohmann::json::array()}};
  for (const auto& [model, at_points] : all)
    object["models"].push_back({{"name", model->name},
                                {"model", model_id(model->document)},
                                {"machine", model->machine},
                                {"cautions", model->cautions},
                                {"effect", effect_name(verify::effect_at_points(at_points))},
                                {"before", vector_figures(at_points.before)},
                                {"after", vector_figures(at_points.after)}});
  fmt::print("{}\n", indented_json_text(object));
}

void print_prediction(const std::string& name, const char* effect,
                      const calib::VectorStatistics& s) {
  fmt::print("{:<32}  {:>9.3f}  {:>9.3f}  {:>9.3f}  {}\n", printable_line(name), kUmPerM * s.mean_m,
             kUmPerM * s.rms_m, kUmPerM * s.max_m, effect);
}

void print_predictions(const std::vector<Predicted>& all, const verify::Observations& observed,
                       const verify::Observations& common) {
  fmt::print("residual errors at {} of {} places, where all models are valid, um\n",
             common.shots.size(), observed.shots.size());
  if (observed.repeatability_m) fmt::print("{}\n", shots_text(observed));
  fmt::print("{:<32}  {:>9}  {:>9}  {:>9}  {}\n", "model", "mean", "rms", "largest", "effect");
  print_prediction("without a model", "", all.front().at_points.before);
  for (const auto& [model, at_points] : all)
    print_prediction(model->name, effect_name(verify::effect_at_points(at_points)),
                     at_points.after);
  for (const auto& [model, at_points] : all)
    for (const std::string& caution : model->cautions)
      fmt::print("{}: {}\n", printable_line(model->name), printable_line(caution));
}

}  // namespace

Result<std::vector<NamedModel>> models_named(const std::vector<std::string>& names,
                                             const StoreOption& store, const std::string& tool) {
  std::vector<NamedModel> models;
  for (const std::string& name : names) {
    auto found = found_model(name, store);
    ABBE_TRY(found);
    const auto tool_m = tool_of(tool, found->document.model);
    ABBE_TRY(tool_m);
    auto cautions = cautions_of(*found);
    auto machine = of_machine(name, *found).machine;
    models.push_back(
        {name, std::move(found->document), std::move(cautions), *tool_m, std::move(machine)});
  }

  constexpr double kSameTool_m = 1e-6;
  for (const NamedModel& model : models) {
    if ((model.tool_m - models.front().tool_m).norm() > kSameTool_m)
      return fail(
          ErrorCode::Usage,
          fmt::format("{} and {} have different tool offsets, the points were measured with "
                      "one: give it with --tool",
                      models.front().name, model.name));
  }
  return models;
}

Result<int> verify_several(const std::vector<NamedModel>& models,
                           const verify::Observations& observed, const SeveralOptions& options) {
  const verify::Observations common = inside_all(observed, models);
  const auto all = predictions(models, common);
  ABBE_TRY(all);
  if (options.json) {
    print_predictions_json(*all, observed, common, options.different_machines);
  } else {
    if (!options.different_machines.empty()) fmt::print("{}\n", options.different_machines);
    print_predictions(*all, observed, common);
  }
  const bool worse = std::ranges::any_of(*all, [](const Predicted& one) {
    return verify::effect_at_points(one.at_points) == verify::Effect::Worse;
  });
  return number(worse ? ExitCode::Worse : ExitCode::Done);
}

}  // namespace abbe::daemon
