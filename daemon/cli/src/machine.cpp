/// `abbe machine`: commands for the measuring machine of the running daemon: where, stop, release.

#include <fmt/format.h>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <array>
#include <memory>
#include <string>

#include "abbe/base/control_protocol.hpp"
#include "abbe/config/capabilities.hpp"
#include "abbe/result/try.hpp"
#include "commands.hpp"
#include "daemon_socket.hpp"
#include "machine_stop.hpp"
#include "terminal.hpp"

namespace abbe::daemon {
namespace {

using nlohmann::json;

Result<json> ask_machine(const DaemonSocket& where, json request) {
  const auto socket = socket_path(where);
  ABBE_TRY(socket);
  request["do"] = "machine";
  return ask_daemon(*socket, request);
}

int release_machine(const DaemonSocket& where) {
  const auto answer = ask_machine(where, {{"release", true}});
  if (!answer) return report(answer.error());
  fmt::print(
      "released: {}\nthe machine may move again (also to home, if {} home = true); `abbe "
      "status` shows when it is ready\n",
      (*answer)["released"].get<std::string>(), tables_with(Capability::Motion));
  return 0;
}

int stop_machine(const DaemonSocket& where) {
  const auto socket = socket_path(where);
  if (!socket) return report(socket.error());
  const auto asked = ask_daemon(*socket, {{"do", "machine"}, {"stop", true}});
  if (!asked) {
    Error error = asked.error();
    if (error.code == ErrorCode::Io)
      error.details.push_back(
          "nobody has confirmed the stop: check the machine, use its emergency stop");
    return report(error);
  }

  const auto number = asked->find("stop");
  if (number == asked->end())
    return report({ErrorCode::StopNotConfirmed,
                   "abbed does not report whether the machine has stopped: check the machine, use "
                   "its emergency stop"});
  const auto stopped = await_stop(*socket, number->get<std::uint64_t>());
  if (!stopped) return report(stopped.error());
  fmt::print("{}\nthe machine does not move again before `abbe machine release`\n", *stopped);
  return 0;
}

int show_machine(const DaemonSocket& where) {
  const auto answer = ask_machine(where, json::object());
  if (!answer) return report(answer.error());
  if ((*answer)["release_awaited"].get<bool>()) {
    fmt::print("release required: check the machine, then run `abbe machine release`: {}\n",
               (*answer)["reason"].get<std::string>());
  }

  if (answer->contains("stop"))
    fmt::print("last stop: {}: {}\n", (*answer)["stop"]["outcome"].get<std::string>(),
               (*answer)["stop"]["text"].get<std::string>());
  if (!answer->contains("tip_m")) {
    fmt::print("the machine has not reported the position of the tip\n");
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
      "machine",
      "Control the measuring machine of the running daemon: where, stop, release; identity of the "
      "machine: identity");
  group->require_subcommand(1);
  add_machine_identity(*group, exit);

  const auto add = [&](const char* name, const std::string& text, int (*run)(const DaemonSocket&)) {
    auto where = std::make_shared<DaemonSocket>();
    auto* command = group->add_subcommand(name, text);
    add_socket_options(*command, *where);
    command->callback([where, run, &exit] { exit = run(*where); });
  };

  add("where", "Show the position of the tip, and whether the machine needs a release",
      show_machine);
  add("stop",
      "Stop every motion that abbed has commanded (AbortE), wait for the outcome and print it; "
      "the\n"
      "machine does not move again before `abbe machine release`. Exit code 0: stopped, the "
      "machine\n"
      "has answered AbortE or no motion was under way. 6: not confirmed, AbortE was refused or "
      "not\n"
      "answered, or the connection was lost before the answer. 7: not sent, there is no "
      "connection\n"
      "to the machine. After 6 and 7 the machine may be moving: use its emergency stop.",
      stop_machine);
  add("release",
      "Confirm that a person has checked the machine. After an error of severity 2 or more, an\n"
      "emergency stop or an aborted motion, abbed moves nothing and clears no error before this\n"
      "command. Then it clears the errors, opens the session again, and sends the machine home if\n"
      "it is not homed and " +
          tables_with(Capability::Motion) + " home = true.",
      release_machine);
}

}  // namespace abbe::daemon
