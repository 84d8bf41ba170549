/// `abbe machine`: what a person does with the measuring machine of the running daemon: look, stop,
/// release.

#include <fmt/format.h>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <array>
#include <memory>
#include <string>

#include "abbe/base/control_protocol.hpp"
#include "commands.hpp"
#include "daemon_socket.hpp"
#include "terminal.hpp"

namespace abbe::daemon {
namespace {

using nlohmann::json;

Result<json> ask_machine(const DaemonSocket& where, json request) {
  const auto socket = socket_path(where);
  if (!socket) return tl::unexpected(socket.error());
  request["do"] = "machine";
  return ask_daemon(*socket, request);
}

int release_machine(const DaemonSocket& where) {
  const auto answer = ask_machine(where, {{"release", true}});
  if (!answer) return report(answer.error());
  fmt::print(
      "released: {}\nthe machine may move again, and home if [cmm] home = true; `abbe status` "
      "shows when it "
      "is "
      "ready\n",
      (*answer)["released"].get<std::string>());
  return 0;
}

int stop_machine(const DaemonSocket& where) {
  const auto answer = ask_machine(where, {{"stop", true}});
  return answer ? 0 : report(answer.error());
}

int show_machine(const DaemonSocket& where) {
  const auto answer = ask_machine(where, json::object());
  if (!answer) return report(answer.error());
  if ((*answer)["release_awaited"].get<bool>()) {
    fmt::print("awaits a release by a person (`abbe machine release`): {}\n",
               (*answer)["reason"].get<std::string>());
  }

  if (!answer->contains("tip_m")) {
    fmt::print("where the tip stands was not reported\n");
    return 0;
  }

  const auto p = (*answer)["tip_m"].get<std::array<double, 3>>();
  fmt::print("tip at X {:.4f}, Y {:.4f}, Z {:.4f} mm, reported {:.1f} s ago\n", 1e3 * p[0],
             1e3 * p[1], 1e3 * p[2], (*answer)["tip_age_s"].get<double>());

  return 0;
}

}  // namespace

void add_machine(CLI::App& parent, int& exit) {
  auto* group = parent.add_subcommand(
      "machine", "The measuring machine of the running daemon: look, stop, release");
  group->require_subcommand(1);

  const auto add = [&](const char* name, const char* text, int (*run)(const DaemonSocket&)) {
    auto where = std::make_shared<DaemonSocket>();
    auto* command = group->add_subcommand(name, text);
    add_socket_options(*command, *where);
    command->callback([where, run, &exit] { exit = run(*where); });
  };

  add("where", "Where the tip stands, and whether the machine awaits a release", show_machine);
  add("stop",
      "Stop every motion that abbed asked for, where it is (AbortE); nothing moves before a "
      "release",
      stop_machine);
  add("release",
      "After an error of severity 2 or more, an emergency stop or an aborted motion nothing moves "
      "and "
      "nothing is\n"
      "cleared before a person has looked at the machine: this says so. Errors are cleared, the "
      "session "
      "begins\n"
      "anew, and the machine is sent home if it is not and [cmm] home = true.",
      release_machine);
}

}  // namespace abbe::daemon
