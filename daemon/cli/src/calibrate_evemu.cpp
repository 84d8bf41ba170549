/// `abbe calibrate evemu`: the running daemon guides the operator through the touches of a ball
/// array and identifies the machine's errors.

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>

#include "abbe/base/units.hpp"
#include "abbe/methods/evemu/task_of_files.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tables/evemu_files.hpp"
#include "commands.hpp"
#include "follow_calibration.hpp"
#include "terminal.hpp"

namespace abbe::daemon {
namespace {

struct CalibrateEvemuArguments {
  FollowOptions follow;
  std::string calibrator, rotation_reference;
  double u_reference_um = 0.0;
  std::size_t points_per_ball = 0, points_per_block = 0;  // 0: from the daemon's configuration
};

Result<nlohmann::json> task_of(const CalibrateEvemuArguments& arguments) {
  const auto calibrator = read_calibrator_toml(arguments.calibrator);
  ABBE_TRY(calibrator);
  std::optional<BallErrorsFile> reference;
  if (!arguments.rotation_reference.empty()) {
    auto read = read_errors_csv(arguments.rotation_reference);
    ABBE_TRY(read);
    reference = std::move(*read);
  }

  nlohmann::json task = evemu_task(*calibrator, reference ? &*reference : nullptr,
                                   arguments.u_reference_um / kUmPerM);
  if (arguments.points_per_ball > 0) task["points_per_ball"] = arguments.points_per_ball;
  if (arguments.points_per_block > 0) task["points_per_block"] = arguments.points_per_block;
  return task;
}

int calibrate(const CalibrateEvemuArguments& arguments) {
  if (arguments.follow.cancel) return cancel_calibration(arguments.follow);
  if (arguments.calibrator.empty())
    return report({ErrorCode::Usage, "calibrate evemu: --calibrator is required", {}});
  const auto task = task_of(arguments);
  return task ? run_calibration(arguments.follow, *task) : report(task.error());
}

}  // namespace

void add_calibrate_evemu(CLI::App& parent, int& exit) {
  auto arguments = std::make_shared<CalibrateEvemuArguments>();
  auto* command = parent.add_subcommand(
      "evemu",
      "Local calibration with a ball array: shows position by position what to touch next\n"
      "(ball 1, block 1, block 2, ball 2 ...), reports missed, repeated and wrong touches, then\n"
      "identifies the model. Ctrl-C stops following (exit code 130); the calibration continues.\n"
      "--cancel ends the calibration.");
  auto* calibrator = command->add_option("--calibrator", arguments->calibrator, "calibrator.toml");
  auto* reference = command->add_option(
      "--rotation-reference", arguments->rotation_reference,
      "errors.csv of points where V is known independently: the model is rotated to fit them;\n"
      "needs --u-reference-um");
  auto* u_reference = command
                          ->add_option("--u-reference-um", arguments->u_reference_um,
                                       "standard uncertainty of that V")
                          ->needs(reference)
                          ->check(CLI::PositiveNumber);
  reference->needs(u_reference);
  command
      ->add_option("--points-per-ball", arguments->points_per_ball,
                   "default: [evemu] of the daemon")
      ->check(CLI::Range(1, 1000));
  command
      ->add_option("--points-per-block", arguments->points_per_block,
                   "default: [evemu] of the daemon")
      ->check(CLI::Range(1, 1000));
  add_follow_options(*command, arguments->follow, calibrator);
  command->callback([arguments, &exit] { exit = calibrate(*arguments); });
}

}  // namespace abbe::daemon
