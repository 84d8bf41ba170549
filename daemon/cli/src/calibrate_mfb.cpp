/// `abbe calibrate mfb`: the running daemon guides the operator through the touches of a
/// Multi-Feature Bar and identifies the 21 errors of the machine.

#include <fmt/format.h>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>

#include "abbe/base/text_file.hpp"
#include "abbe/methods/calibration_request.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tables/mfb_files.hpp"
#include "commands.hpp"
#include "follow_calibration.hpp"
#include "mfb_recording.hpp"
#include "terminal.hpp"

namespace abbe::daemon {
namespace {

struct CalibrateMfbArguments {
  FollowOptions follow;
  std::string bar, plan, recording;
};

Result<MfbRequest::File> file_with_text(const std::string& file) {
  auto text = read_text(file);
  ABBE_TRY(text);
  return MfbRequest::File{std::filesystem::path(file).filename().string(), std::move(*text)};
}

/// The request from the files. Bar and plan are also checked here, so that messages contain the
/// file names as the user gave them.
Result<MfbRequest> request_of_files(const CalibrateMfbArguments& arguments) {
  auto bar_file = file_with_text(arguments.bar);
  ABBE_TRY(bar_file);
  const auto bar = parse_bar_toml(bar_file->text, arguments.bar);
  ABBE_TRY(bar);
  auto plan_file = file_with_text(arguments.plan);
  ABBE_TRY(plan_file);
  ABBE_TRY(parse_bar_plan_toml(plan_file->text, arguments.plan, bar->bar));
  return MfbRequest{std::move(*bar_file), std::move(*plan_file), {}};
}

/// The request from a recording: the touches of an interrupted session, with its bar and plan.
Result<MfbRequest> request_of_recording(const CalibrateMfbArguments& arguments) {
  const auto recording = open_recording(arguments.recording);
  ABBE_TRY(recording);
  return bar_request_to_continue(*recording);
}

int calibrate(const CalibrateMfbArguments& arguments) {
  if (arguments.follow.cancel) return cancel_calibration(arguments.follow);
  const bool continued = !arguments.recording.empty();
  if (!continued && (arguments.bar.empty() || arguments.plan.empty()))
    return report({ErrorCode::Usage,
                   "calibrate mfb: --bar and --plan are required, or --continue with the recording "
                   "of an interrupted session",
                   {}});
  auto request = continued ? request_of_recording(arguments) : request_of_files(arguments);
  if (!request) return report(request.error());
  if (continued)
    fmt::print(stderr, "{} touches of {} are used again\n", request->earlier_m.size(),
               arguments.recording);
  return run_calibration(arguments.follow, to_json(CalibrationTask{std::move(*request)}));
}

}  // namespace

void add_calibrate_mfb(CLI::App& parent, int& exit) {
  auto arguments = std::make_shared<CalibrateMfbArguments>();
  auto* command = parent.add_subcommand(
      "mfb",
      "Calibration with a Multi-Feature Bar: shows measurement by measurement of the plan what to\n"
      "touch next (hole 1, rod 1 and its planes, hole 2 ...; a backward pass the other way),\n"
      "reports missed, repeated and wrong touches, then identifies all 21 errors. Ctrl-C stops\n"
      "following (exit code 130); the calibration continues. --cancel ends the calibration.");
  auto* bar = command->add_option("--bar", arguments->bar, "bar.toml: the calibrated bar");
  auto* plan = command->add_option(
      "--plan", arguments->plan, "plan.toml, as abbe plan mfb writes it: positions, tools, passes");
  auto* recording =
      command
          ->add_option(
              "--continue", arguments->recording,
              "recording of an interrupted session (.mcap): its bar, its plan and the touches\n"
              "made in it are used; the session goes on at the next touch")
          ->excludes(bar)
          ->excludes(plan);
  add_follow_options(*command, arguments->follow, bar);
  command->get_option("--cancel")->excludes(plan)->excludes(recording);
  command->callback([arguments, &exit] { exit = calibrate(*arguments); });
}

}  // namespace abbe::daemon
