#include "abbe/tasks/compare_models.hpp"

#include <fmt/format.h>

#include <array>
#include <utility>

#include "abbe/result/try.hpp"
#include "abbe/tasks/direction_option.hpp"
#include "abbe/tasks/same_machine.hpp"

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
  const auto found_a = found_model(arguments.a, arguments.store);
  ABBE_TRY(found_a);
  const auto found_b = found_model(arguments.b, arguments.store);
  ABBE_TRY(found_b);
  const std::array machines{of_machine(arguments.a, *found_a), of_machine(arguments.b, *found_b)};
  auto different = require_same_machine("model compare", machines, arguments.other_machine);
  ABBE_TRY(different);
  const ModelDocument *const a = &found_a->document, *const b = &found_b->document;

  const auto travel = parse_direction(arguments.direction);
  ABBE_TRY(travel);
  if (!arguments.direction.empty() && b->model.travel() == nullptr) {
    ABBE_TRY(require_travel(a->model, arguments.a));
  }

  const auto points = common_points(a->model, b->model);
  const auto difference = calib::rigid_free_difference(
      a->model, b->model, a->model.tool_offsets_m().front(), points, *travel);
  if (!difference)
    return fail(ErrorCode::DataInsufficient,
                fmt::format("{} and {}: {}", arguments.a, arguments.b, difference.error().text));
  return ModelsComparison{points.size(),         *difference,         cautions_of(*found_a),
                          cautions_of(*found_b), machines[0].machine, machines[1].machine,
                          *std::move(different)};
}

}  // namespace abbe::daemon
