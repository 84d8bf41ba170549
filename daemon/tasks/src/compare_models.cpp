#include "abbe/tasks/compare_models.hpp"

#include <fmt/format.h>

#include <array>
#include <utility>

#include "abbe/result/try.hpp"
#include "abbe/tasks/direction_option.hpp"

namespace abbe::daemon {
namespace {

/// The points of comparison: those nodes of the two models that are in the validity volume of both.
std::vector<calib::Vector3> common_points(const calib::VolumetricModel& a,
                                          const calib::VolumetricModel& b) {
  std::vector<calib::Vector3> points;
  for (const auto* nodes : {&a.nodes(), &b.nodes()}) {
    for (const calib::Vector3& q : calib::tensor_grid(*nodes)) {
      if (a.validity().contains(q) && b.validity().contains(q)) points.push_back(q);
    }
  }
  return points;
}

}  // namespace

Result<ModelsComparison> compare_models(const CompareModelsArguments& arguments) {
  if (arguments.b.empty())
    return fail(ErrorCode::Usage, "model compare: give a second model B, or --measured");
  auto a = compared_model(arguments.a, arguments.store);
  ABBE_TRY(a);
  auto b = compared_model(arguments.b, arguments.store);
  ABBE_TRY(b);
  const std::array machines{OfMachine{a->name, a->machine}, OfMachine{b->name, b->machine}};
  auto different = require_same_machine("model compare", machines, arguments.other_machine);
  ABBE_TRY(different);
  const auto &model_a = a->document.model, &model_b = b->document.model;

  const auto travel = parse_direction(arguments.direction);
  ABBE_TRY(travel);
  if (!arguments.direction.empty() && model_b.travel() == nullptr) {
    ABBE_TRY(require_travel(model_a, arguments.a));
  }

  const auto points = common_points(model_a, model_b);
  const auto difference = calib::rigid_free_difference(
      model_a, model_b, model_a.tool_offsets_m().front(), points, *travel);
  if (!difference)
    return fail(ErrorCode::DataInsufficient,
                fmt::format("{} and {}: {}", arguments.a, arguments.b, difference.error().text));
  return ModelsComparison{*std::move(a), *std::move(b), points.size(), *difference,
                          *std::move(different)};
}

}  // namespace abbe::daemon
