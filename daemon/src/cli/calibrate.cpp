/// `abbe calibrate otf`: asks the running daemon for a calibration and follows it to its verdict.

#include <fmt/format.h>
#include <signal.h>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <chrono>
#include <csignal>
#include <memory>
#include <string>
#include <thread>

#include "abbe/daemon/control_protocol.hpp"
#include "abbe/daemon/input_files.hpp"
#include "cli/commands.hpp"
#include "cli/daemon_socket.hpp"
#include "cli/terminal.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;

constexpr auto kLook = 200ms;  // how often a person's progress bar moves
constexpr auto kPatienceWithoutDaemon = 5s;

struct Arguments {
  DaemonSocket where;
  std::string path_file;
  bool detach = false;
  bool cancel = false;
  bool json = false;
};

int print_verdict(const json& session, bool as_json) {
  const std::string state = session["state"];
  if (as_json) {
    fmt::print("{}\n", session.dump(1));
  } else {
    fmt::print("{} {}\n{}\n", state, session["model_id"].get<std::string>(),
               session["reason"].get<std::string>());
  }
  if (state == "active") return 0;
  // Refused with a model: the gate. Without: the data did not allow one, or the run was not completed.
  return session["model_id"].get<std::string>().empty() ? 1 : 5;
}

volatile std::sig_atomic_t interrupted = 0;  // written by the signal handler

/// Ctrl-C ends the looking on, not the calibration: that takes a word to the daemon.
void leave_on_interrupt() {
  struct sigaction leave {};
  leave.sa_handler = [](int) { interrupted = 1; };
  ::sigaction(SIGINT, &leave, nullptr);
}

int say_how_to_cancel(const std::filesystem::path& socket) {
  constexpr int kInterrupted = 128 + SIGINT;  // what a shell reports
  fmt::print(stderr, "abbe: the calibration goes on; end it with: abbe calibrate otf --cancel --socket {}\n",
             socket.string());
  return kInterrupted;
}

/// One line whenever the daemon is about something else: "warming: waiting for the machine to stand at ...".
class Narrator {
 public:
  void tell(ProgressBar& bar, const std::string& state, const std::string& reason) {
    std::string line = fmt::format("{}: {}", state, reason);
    if (line == told_) return;
    bar.clear();
    fmt::print(stderr, "{}\n", line);
    told_ = std::move(line);
  }

 private:
  std::string told_;
};

int follow(const std::filesystem::path& socket, bool as_json) {
  leave_on_interrupt();
  ProgressBar bar;
  Narrator narrator;
  auto answered = std::chrono::steady_clock::now();
  for (;; std::this_thread::sleep_for(kLook)) {
    if (interrupted != 0) {
      bar.clear();
      return say_how_to_cancel(socket);
    }
    const auto status = ask_daemon(socket, {{"do", "status"}});
    const auto now = std::chrono::steady_clock::now();
    if (!status) {
      if (now - answered < kPatienceWithoutDaemon) continue;
      bar.clear();
      return report(status.error());
    }
    answered = now;
    const json& session = (*status)["session"];
    const std::string state = session["state"];
    if (state == "active" || state == "refused" || state == "idle") {
      bar.clear();
      return print_verdict(session, as_json);
    }
    narrator.tell(bar, state, session["reason"]);
    bar.show(state, session["progress"].get<double>());
  }
}

int cancel(const std::filesystem::path& socket) {
  const auto answer = ask_daemon(socket, {{"do", "cancel"}, {"who", user_name()}});
  return answer ? 0 : report(answer.error());
}

int calibrate(const Arguments& arguments) {
  const auto socket = socket_path(arguments.where);
  if (!socket) return report(socket.error());
  if (arguments.cancel) return cancel(*socket);
  const auto path = read_path_csv(arguments.path_file);
  if (!path) return report(path.error());
  const auto started = ask_daemon(
      *socket, {{"do", "calibrate"}, {"method", "otf"}, {"path_m", path->vertices_m}, {"who", user_name()}});
  if (!started) return report(started.error());
  return arguments.detach ? 0 : follow(*socket, arguments.json);
}

}  // namespace

void add_calibrate_otf(CLI::App& parent, int& exit) {
  auto arguments = std::make_shared<Arguments>();
  auto* command =
      parent.add_subcommand("otf",
                            "On the fly with a laser tracker: waits until the machine stands at "
                            "the first vertex, then drive the path.\n"
                            "Ctrl-C ends the looking on (exit code 130), --cancel the calibration.");
  auto* path =
      command->add_option("--path", arguments->path_file, "the path the machine will drive: x_mm,y_mm,z_mm");
  add_socket_options(*command, arguments->where);
  command->add_flag("--detach", arguments->detach, "return as soon as the daemon waits for the machine");
  command->add_flag("--cancel", arguments->cancel, "end the calibration that is running")->excludes(path);
  command->add_flag("--json", arguments->json, "the verdict as JSON");
  command->callback([arguments, &exit] {
    exit = arguments->path_file.empty() && !arguments->cancel
               ? report({ErrorCode::Usage, "calibrate otf: --path is needed", {}})
               : calibrate(*arguments);
  });
}

}  // namespace abbe::daemon
