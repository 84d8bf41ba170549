/// `abbe reference`: references the axes: the running daemon finds the position of count 0 of their
/// counters from distance-coded reference marks.

#include <fmt/format.h>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "abbe/base/control_protocol.hpp"
#include "abbe/base/json_text.hpp"
#include "abbe/pipeline/reference_session.hpp"
#include "commands.hpp"
#include "daemon_socket.hpp"
#include "follow.hpp"
#include "terminal.hpp"

namespace abbe::daemon {
namespace {

using nlohmann::json;

struct ReferenceArguments {
  DaemonSocket where;
  bool cancel = false;
  bool here = false;
  std::vector<std::string> axes;
  double u_um = 1e6 * SetZeroHere::kByEye;
  bool json = false;
};

std::string line_of(const json& axis) {
  const std::string state = axis["state"];
  if (state == "found") {
    const bool rotary = axis.value("kind", "linear") == "rotary";
    return fmt::format("{:<4} found after {} marks: count 0 is at {:.{}f} {}, u = {:.3f} {}",
                       axis["axis"].get<std::string>(), axis["marks"].get<std::size_t>(),
                       (rotary ? 1.0 : 1e3) * axis["reading_at_zero"].get<double>(), rotary ? 9 : 6,
                       rotary ? "rad" : "mm", 1e6 * axis["u"].get<double>(),
                       rotary ? "urad" : "um");
  }

  return fmt::format("{:<4} {}, {} marks{}{}", axis["axis"].get<std::string>(), state,
                     axis["marks"].get<std::size_t>(),
                     axis["reason"].get<std::string>().empty() ? "" : ": ",
                     axis["reason"].get<std::string>());
}

/// Prints one line to stderr whenever the state of an axis has changed.
class ReferenceLog {
 public:
  void print_changes(const json& reference) {
    for (const json& axis : reference["axes"]) {
      std::string line = line_of(axis);
      if (printed_[axis["axis"]] == line) continue;
      fmt::print(stderr, "{}\n", line);
      printed_[axis["axis"]] = std::move(line);
    }
  }

 private:
  std::map<std::string, std::string> printed_;  // the last printed line of each axis
};

int print_result(const json& reference, bool as_json) {
  bool all = true;
  for (const json& axis : reference["axes"]) {
    all = all && axis["state"] == "found";
    if (!as_json) fmt::print("{}\n", line_of(axis));
  }
  if (as_json) fmt::print("{}\n", indented_json_text(reference));
  return all ? 0 : 1;
}

int follow_search(const std::filesystem::path& socket, bool as_json) {
  ProgressBar no_bar{false};
  ReferenceLog log;
  const auto look = [&](const json& status) -> std::optional<int> {
    const json& found = status["reference"];
    if (!found["running"].get<bool>()) return print_result(found, as_json);
    log.print_changes(found);
    return std::nullopt;
  };

  return follow({.socket = socket,
                 .what = "the search for the marks",
                 .cancel = "abbe reference --cancel",
                 .look = look},
                no_bar);
}

int reference(const ReferenceArguments& arguments) {
  const auto socket = socket_path(arguments.where);
  if (!socket) return report(socket.error());
  const auto answer = ask_daemon(*socket, {{"do", "reference"},
                                           {"cancel", arguments.cancel},
                                           {"here", arguments.here},
                                           {"axes", arguments.axes},
                                           {"u", arguments.u_um / 1e6}});
  if (!answer) return report(answer.error());
  return arguments.cancel || arguments.here ? 0 : follow_search(*socket, arguments.json);
}

}  // namespace

void add_reference(CLI::App& parent, int& exit) {
  auto arguments = std::make_shared<ReferenceArguments>();
  auto* command = parent.add_subcommand("reference",
                                        "Reference the axes from distance-coded reference marks: "
                                        "run this command, then drive each axis slowly\n"
                                        "over at least four marks in one direction. Ends when "
                                        "every axis of [reference] is referenced.\n"
                                        "Ctrl-C stops following (exit code 130); the search "
                                        "continues. --cancel ends the search.");
  add_socket_options(*command, arguments->where);
  auto* cancel = command->add_flag("--cancel", arguments->cancel, "end the running search");
  auto* here = command->add_flag(
      "--here", arguments->here,
      "reference the axes without marks at their present position: they are where they read their\n"
      "offset. Refused while they move, while the counter card sends no data, and while a\n"
      "calibration takes readings");
  here->excludes(cancel);
  command->add_option("--axis", arguments->axes, "with --here: only these axes")->needs(here);
  command
      ->add_option("--u-um", arguments->u_um,
                   "with --here: standard uncertainty of the position, um (rotary axis: urad); "
                   "100: set by eye")
      ->check(CLI::PositiveNumber)
      ->capture_default_str()
      ->needs(here);
  command->add_flag("--json", arguments->json, "print the result as JSON");
  command->callback([arguments, &exit] { exit = reference(*arguments); });
}

}  // namespace abbe::daemon
