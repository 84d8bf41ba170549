/// `abbe model compare A B`: the difference of two models, in the volume where both are valid; or
/// of a model and directly measured error motions.

#include <fmt/format.h>

#include <memory>
#include <nlohmann/json.hpp>

#include "abbe/base/json_text.hpp"
#include "abbe/base/printable.hpp"
#include "abbe/base/units.hpp"
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

void print(const char* what, const calib::VectorStatistics& s) {
  fmt::print("{:<24}  {:>9.3f}  {:>9.3f}  {:>9.3f}\n", what, s.mean_m * kUmPerM, s.rms_m * kUmPerM,
             s.max_m * kUmPerM);
}

int run_measured(const CompareCommand& arguments) {
  const auto found = found_model(arguments.a, arguments.store);
  if (!found) return report(found.error());
  print_cautions(arguments.a, *found);
  const auto exit =
      compare_with_measured(found->document.model, arguments.measured, arguments.json);
  return exit ? *exit : report(exit.error());
}

int run(const CompareCommand& arguments) {
  const auto found = compare_models(arguments);
  if (!found) return report(found.error());
  const auto& d = found->difference;

  if (arguments.json) {
    const nlohmann::json object{{"points", found->points},
                                {"as_stated", vector_figures(d.as_stated)},
                                {"rigid_free", vector_figures(d.rigid_free)},
                                {"machine_a", found->machine_a},
                                {"machine_b", found->machine_b},
                                {"cautions_a", found->cautions_a},
                                {"cautions_b", found->cautions_b}};
    fmt::print("{}\n", indented_json_text(object));
    return 0;
  }

  if (!found->different_machines.empty()) fmt::print("{}\n", found->different_machines);
  for (const auto& caution : found->cautions_a) fmt::print("A: {}\n", printable_line(caution));
  for (const auto& caution : found->cautions_b) fmt::print("B: {}\n", printable_line(caution));
  fmt::print("|V(A) - V(B)| at {} nodes where both are valid, um\n", found->points);
  fmt::print("{:<24}  {:>9}  {:>9}  {:>9}\n", "", "mean", "rms", "largest");
  print("as stated", d.as_stated);
  print("without a rigid motion", d.rigid_free);

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
  command
      ->add_option("A", arguments->a,
                   "model.json; or a model of the store: its id, the beginning of its id, or "
                   "\"active\"")
      ->required();
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
    if (!arguments->measured.file.empty())
      exit = run_measured(*arguments);
    else if (arguments->b.empty())
      exit = report({ErrorCode::Usage, "model compare: give a second model B, or --measured"});
    else
      exit = run(*arguments);
  });
}

}  // namespace abbe::daemon
