#include "verify_several.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "abbe/base/json_text.hpp"
#include "abbe/base/printable.hpp"
#include "abbe/base/units.hpp"
#include "abbe/tasks/effect_name.hpp"
#include "figures.hpp"

namespace abbe::daemon {
namespace {

void print_prediction(const std::string& name, const char* effect,
                      const calib::VectorStatistics& s) {
  fmt::print("{:<32}  {:>9.3f}  {:>9.3f}  {:>9.3f}  {}\n", printable_line(name), kUmPerM * s.mean_m,
             kUmPerM * s.rms_m, kUmPerM * s.max_m, effect);
}

}  // namespace

void print_json(const SeveralOutcome& outcome) {
  const auto& observed = outcome.observations;
  nlohmann::json object{{"points", observed.shot_count()},
                        {"places", observed.shots.size()},
                        {"inside_all", outcome.inside_all},
                        {"repeatability_um", repeatability_figure(observed)},
                        {"different_machines", outcome.different_machines},
                        {"models", nlohmann::json::array()}};
  for (const auto& [model, tool_m, compared] : outcome.models)
    object["models"].push_back({{"name", model.name},
                                {"model", model_id(model.document)},
                                {"machine", model.machine},
                                {"cautions", model.cautions},
                                {"effect", effect_name(calib::verify::effect_at_points(compared))},
                                {"before", vector_figures(compared.before)},
                                {"after", vector_figures(compared.after)}});
  fmt::print("{}\n", indented_json_text(object));
}

void print_summary(const SeveralOutcome& outcome) {
  const auto& observed = outcome.observations;
  if (!outcome.different_machines.empty()) fmt::print("{}\n", outcome.different_machines);
  fmt::print("residual errors at {} of {} places, where all models are valid, um\n",
             outcome.inside_all, observed.shots.size());
  if (observed.repeatability_m) fmt::print("{}\n", shots_text(observed));
  fmt::print("{:<32}  {:>9}  {:>9}  {:>9}  {}\n", "model", "mean", "rms", "largest", "effect");
  print_prediction("without a model", "", outcome.models.front().comparison.before);
  for (const auto& [model, tool_m, compared] : outcome.models)
    print_prediction(model.name, effect_name(calib::verify::effect_at_points(compared)),
                     compared.after);
  for (const auto& [model, tool_m, compared] : outcome.models)
    for (const std::string& caution : model.cautions)
      fmt::print("{}: {}\n", printable_line(model.name), printable_line(caution));
}

}  // namespace abbe::daemon
