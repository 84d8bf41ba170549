/// `abbe model compare A B`: prints the difference of two models in the volume where both are
/// valid, or the difference between a model and directly measured error motions.

#include <fmt/format.h>

#include <memory>
#include <nlohmann/json.hpp>

#include "abbe/base/json_text.hpp"
#include "abbe/base/printable.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tasks/compare_models.hpp"
#include "commands.hpp"
#include "figures.hpp"
#include "measured_comparison.hpp"
#include "same_machine.hpp"
#include "store_option.hpp"
#include "terminal.hpp"

namespace abbe::daemon {
namespace {

struct CompareCommand : CompareModelsArguments {
  MeasuredOptions measured;
  bool json = false;
};

nlohmann::json models_json(const ModelsComparison& found) {
  return {{"points", found.points},
          {"as_stated", vector_figures(found.difference.as_stated)},
          {"rigid_free", vector_figures(found.difference.rigid_free)},
          {"machine_a", found.a.machine},
          {"machine_b", found.b.machine},
          {"cautions_a", found.a.cautions},
          {"cautions_b", found.b.cautions}};
}

void print_models(const ModelsComparison& found) {
  constexpr VectorColumns kDifference{.name = 24, .figure = 9};
  if (!found.different_machines.empty()) fmt::print("{}\n", found.different_machines);
  for (const auto& caution : found.a.cautions) fmt::print("A: {}\n", printable_line(caution));
  for (const auto& caution : found.b.cautions) fmt::print("B: {}\n", printable_line(caution));
  fmt::print("|V(A) - V(B)| at {} nodes where both are valid, um\n", found.points);
  fmt::print("{}\n", vector_heading("", kDifference));
  fmt::print("{}\n", vector_row("as stated", found.difference.as_stated, kDifference));
  fmt::print("{}\n",
             vector_row("without a rigid motion", found.difference.rigid_free, kDifference));
}

/// Compares and prints. Returns the exit code.
Result<int> compare(const CompareCommand& arguments) {
  if (!arguments.measured.file.empty()) {
    const auto model = found_model(arguments.a, arguments.store);
    ABBE_TRY(model);
    print_cautions(arguments.a, *model);
    return compare_with_measured(model->document.model, arguments.measured, arguments.json);
  }
  const auto found = compare_models(arguments);
  ABBE_TRY(found);
  if (arguments.json)
    fmt::print("{}\n", indented_json_text(models_json(*found)));
  else
    print_models(*found);
  return 0;
}

}  // namespace

void add_model_compare(CLI::App& parent, int& exit) {
  auto arguments = std::make_shared<CompareCommand>();
  auto* command = parent.add_subcommand(
      "compare",
      "Print the difference of two models at the nodes where both are valid, for the tool of A:\n"
      "as stated, and without the rigid motion of the whole volume, which no measurement can "
      "determine.\nModels of different machines need "
      "--other-machine.\nWith --measured FILE instead of B: the difference of directly measured "
      "error "
      "motions and A.");
  command->add_option("A", arguments->a, kModelText)->required();
  auto* b = command->add_option("B", arguments->b, "the other model, given like A");
  auto* measured = add_measured_options(*command, arguments->measured);
  measured->excludes(b);
  add_store_options(*command, arguments->store);
  auto* direction = command->add_option(
      "--direction", arguments->direction,
      "direction in which X, Y and Z last moved, such as +,-,0 (0: not known); a "
      "model without backlash is the mean of both directions");
  measured->excludes(direction);  // measurements are the mean of both directions
  add_other_machine_option(*command, arguments->other_machine);
  command->add_flag("--json", arguments->json, "print one JSON object");
  command->callback([arguments, &exit] {
    const auto code = compare(*arguments);
    exit = code ? *code : report(code.error());
  });
}

}  // namespace abbe::daemon
