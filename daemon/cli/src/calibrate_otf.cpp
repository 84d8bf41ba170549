/// `abbe calibrate otf`: asks the running daemon for a calibration and follows it to its verdict.

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
  std::string path_file;
};

int calibrate(const CalibrateOtfArguments& arguments) {
  if (arguments.follow.cancel) return cancel_calibration(arguments.follow);
  if (arguments.path_file.empty())
    return report({ErrorCode::Usage, "calibrate otf: --path is needed", {}});
  const auto path = read_path_csv(arguments.path_file);
  if (!path) return report(path.error());
  return run_calibration(arguments.follow, to_json(OtfRequest{path->vertices_m}));
}

}  // namespace

void add_calibrate_otf(CLI::App& parent, int& exit) {
  auto arguments = std::make_shared<CalibrateOtfArguments>();
  auto* command = parent.add_subcommand(
      "otf",
      "On the fly with a laser tracker: waits until the machine stands at "
      "the first vertex, then drive the path.\n"
      "Ctrl-C ends the looking on (exit code 130), --cancel the calibration.");
  auto* path = command->add_option("--path", arguments->path_file,
                                   "the path the machine will drive: x_mm,y_mm,z_mm");
  add_follow_options(*command, arguments->follow, path);
  command->callback([arguments, &exit] { exit = calibrate(*arguments); });
}

}  // namespace abbe::daemon
