/// `abbe calibrate otf`: requests a calibration from the running daemon and follows it to its
/// verdict.

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <memory>
#include <string>

#include "abbe/methods/calibration_request.hpp"
#include "abbe/tables/input_files.hpp"
#include "commands.hpp"
#include "follow_calibration.hpp"
#include "terminal.hpp"

namespace abbe::daemon {
namespace {

struct CalibrateOtfArguments {
  FollowOptions follow;
  std::string path_file, mode;
};

int calibrate(const CalibrateOtfArguments& arguments) {
  if (arguments.follow.cancel) return cancel_calibration(arguments.follow);
  if (arguments.path_file.empty())
    return report({ErrorCode::Usage, "calibrate otf: --path is required", {}});
  const auto path = read_path_csv(arguments.path_file);
  if (!path) return report(path.error());
  return run_calibration(
      arguments.follow,
      to_json(OtfRequest{path->vertices_m, calib::otf::mode_named(arguments.mode)}));
}

}  // namespace

void add_calibrate_otf(CLI::App& parent, int& exit) {
  auto arguments = std::make_shared<CalibrateOtfArguments>();
  auto* command = parent.add_subcommand(
      "otf",
      "On-the-fly calibration with a laser tracker: waits until the machine stands at the first\n"
      "vertex; then drive the machine along the path. Ctrl-C stops following (exit code 130); the\n"
      "calibration continues. --cancel ends the calibration.");
  auto* path = command->add_option("--path", arguments->path_file,
                                   "path.csv: vertices of the path to drive: x_mm,y_mm,z_mm");
  command
      ->add_option("--mode", arguments->mode,
                   "on-the-fly, or standstill: let the machine stop at every vertex for 0.3 s or\n"
                   "longer; default: [otf] mode of the daemon")
      ->check(CLI::IsMember({"on-the-fly", "standstill"}));
  add_follow_options(*command, arguments->follow, path);
  command->callback([arguments, &exit] { exit = calibrate(*arguments); });
}

}  // namespace abbe::daemon
