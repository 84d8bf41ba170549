/// `abbe model drift A B`: tests whether the machine has changed from model A to model B.

#include <fmt/format.h>
#include <unistd.h>

#include <memory>
#include <nlohmann/json.hpp>

#include "abbe/base/error.hpp"
#include "abbe/base/json_text.hpp"
#include "abbe/base/units.hpp"
#include "abbe/calib/model/model_drift.hpp"
#include "abbe/tasks/model_drift.hpp"
#include "commands.hpp"
#include "same_machine.hpp"
#include "store_option.hpp"
#include "terminal.hpp"

namespace abbe::daemon {
namespace {

struct ModelDriftCommand : ModelDriftArguments {
  bool json = false;
};

constexpr double kMicroPerSi = 1e6;

nlohmann::json drift_json(const calib::ChiSquare& test) {
  return {{"chi2", test.statistic}, {"dof", test.dof}, {"p", test.p}, {"limit", test.limit}};
}

nlohmann::json drift_json(const calib::TableChange& change) {
  nlohmann::json object = drift_json(change.test);
  object["table"] = change.table;
  object["drifted"] = change.drifted;
  object["test"] = change.smooth ? "smooth" : "any";
  object["unit"] = change.is_angle ? "urad" : "um";
  object["change"] = change.change * kMicroPerSi;
  object["u"] = change.u * kMicroPerSi;
  object["position_mm"] =
      change.position_m ? nlohmann::json(*change.position_m * kMmPerM) : nlohmann::json();
  return object;
}

nlohmann::json drift_json(const calib::DriftTest& drift) {
  nlohmann::json object{{"drifted", drift.drifted},
                        {"tables", nlohmann::json::array()},
                        {"all", drift_json(drift.all)},
                        {"rest", drift_json(drift.rest)},
                        {"untested_combinations", drift.untested}};
  for (const auto& change : drift.tables) object["tables"].push_back(drift_json(change));
  return object;
}

void print(const calib::TableChange& c) {
  const std::string place =
      c.position_m ? fmt::format("{:.1f}", *c.position_m * kMmPerM) : std::string("-");
  const std::string state = c.drifted ? coloured("DRIFT", kRed, STDOUT_FILENO) : "";
  fmt::print("{:<5}  {:>9.3f}  {:>8.3f}  {:<4}  {:>8}  {:>9.2f}  {:>3}  {:>8.1e}  {}\n", c.table,
             c.change * kMicroPerSi, c.u * kMicroPerSi, c.is_angle ? "urad" : "um", place,
             c.test.statistic, c.test.dof, c.test.p, state);
}

void print(const calib::DriftTest& drift) {
  fmt::print("{:<5}  {:>9}  {:>8}  {:<4}  {:>8}  {:>9}  {:>3}  {:>8}\n", "table", "change", "u",
             "unit", "at mm", "chi2", "dof", "p");
  for (const auto& change : drift.tables) print(change);
  fmt::print("all    chi2 {:.2f} with {} degrees of freedom, p {:.1e}\n", drift.all.statistic,
             drift.all.dof, drift.all.p);
  if (drift.untested > 0)
    fmt::print("       not tested: {} combinations without uncertainty\n", drift.untested);
  if (drift.drifted) {
    fmt::print("\nB differs from A: {}\n", calib::text(drift));
  } else {
    fmt::print("\nno table differs by more than its uncertainty\n");
  }
}

int run_model_drift(const ModelDriftCommand& arguments) {
  const auto found = model_drift(arguments);
  if (!found) return report(found.error());

  if (arguments.json) {
    auto object = drift_json(found->test);
    object["machine_a"] = found->machine_a;
    object["machine_b"] = found->machine_b;
    fmt::print("{}\n", indented_json_text(object));
  } else {
    if (!found->different_machines.empty()) fmt::print("{}\n", found->different_machines);
    print(found->test);
  }
  return found->test.drifted ? exit_code(ErrorCode::Refused) : 0;
}

}  // namespace

void add_model_drift(CLI::App& parent, int& exit) {
  auto arguments = std::make_shared<ModelDriftCommand>();
  auto* command = parent.add_subcommand(
      "drift",
      "Test every table of model B against model A, with the uncertainty of both: has the machine\n"
      "changed? For models of the same nodes and tool; models of different machines need\n"
      "--other-machine. Prints the change of each table\n"
      "where it is largest, if this table and those marked DRIFT are all that changed.\n"
      "Exit code 0: no table differs by more than its uncertainty; 5: one does; 1: the models\n"
      "cannot be compared table by table (`abbe model compare` can).");
  command
      ->add_option("A", arguments->a,
                   "the earlier model: model.json; or a model of the store: its id, the beginning "
                   "of its id, or \"active\"")
      ->required();
  command->add_option("B", arguments->b, "the later model, given like A")->required();
  add_store_options(*command, arguments->store);
  command
      ->add_option("--false-alarm", arguments->false_alarm,
                   "probability of an alarm if nothing changed")
      ->capture_default_str();
  add_other_machine_option(*command, arguments->other_machine);
  command->add_flag("--json", arguments->json, "print one JSON object");
  command->callback([arguments, &exit] { exit = run_model_drift(*arguments); });
}

}  // namespace abbe::daemon
