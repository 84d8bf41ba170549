#include "cli/follow_calibration.hpp"

#include <fmt/format.h>
#include <signal.h>

#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <algorithm>
#include <chrono>
#include <csignal>
#include <thread>
#include <utility>

#include "abbe/daemon/control_protocol.hpp"
#include "cli/terminal.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;

constexpr auto kLook = 200ms;  // how often a person's progress bar moves
constexpr auto kPatienceWithoutDaemon = 5s;

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

int say_how_to_cancel(const std::filesystem::path& socket, const std::string& method) {
  constexpr int kInterrupted = 128 + SIGINT;  // what a shell reports
  fmt::print(stderr, "abbe: the calibration goes on; end it with: abbe calibrate {} --cancel --socket {}\n",
             method, socket.string());
  return kInterrupted;
}

/// One line whenever the daemon is about something else: "warming: waiting for the machine to stand at ...",
/// and one for everything it noticed meanwhile.
class Narrator {
 public:
  void tell_notes(ProgressBar& bar, const json& session) {
    const auto noted = session.value("noted", std::size_t{0});
    const json notes = session.value("notes", json::array());
    if (noted < noted_) noted_ = 0;  // another session
    const std::size_t fresh = std::min(noted - noted_, notes.size());
    if (fresh > 0) bar.clear();
    for (std::size_t i = notes.size() - fresh; i < notes.size(); ++i)
      fmt::print(stderr, "  {}\n", notes[i].get<std::string>());
    noted_ = noted;
  }
  void tell(ProgressBar& bar, const std::string& state, const std::string& reason) {
    std::string line = fmt::format("{}: {}", state, reason);
    if (line == told_) return;
    bar.clear();
    fmt::print(stderr, "{}\n", line);
    told_ = std::move(line);
  }

 private:
  std::string told_;
  std::size_t noted_ = 0;
};

int follow(const std::filesystem::path& socket, const std::string& method, bool as_json) {
  leave_on_interrupt();
  ProgressBar bar;
  Narrator narrator;
  auto answered = std::chrono::steady_clock::now();
  for (;; std::this_thread::sleep_for(kLook)) {
    if (interrupted != 0) {
      bar.clear();
      return say_how_to_cancel(socket, method);
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
    narrator.tell_notes(bar, session);
    if (state == "active" || state == "refused" || state == "idle") {
      bar.clear();
      return print_verdict(session, as_json);
    }
    narrator.tell(bar, state, session["reason"]);
    bar.show(state, session["progress"].get<double>());
  }
}

}  // namespace

void add_follow_options(CLI::App& command, FollowOptions& options, CLI::Option* excluded) {
  add_socket_options(command, options.where);
  command.add_flag("--detach", options.detach, "return as soon as the daemon waits for the machine");
  command.add_flag("--cancel", options.cancel, "end the calibration that is running")->excludes(excluded);
  command.add_flag("--json", options.json, "the verdict as JSON");
}

int cancel_calibration(const FollowOptions& options) {
  const auto socket = socket_path(options.where);
  if (!socket) return report(socket.error());
  const auto answer = ask_daemon(*socket, {{"do", "cancel"}, {"who", user_name()}});
  return answer ? 0 : report(answer.error());
}

int run_calibration(const FollowOptions& options, json task) {
  const auto socket = socket_path(options.where);
  if (!socket) return report(socket.error());
  const auto method = task.at("method").get<std::string>();
  task["do"] = "calibrate";
  task["who"] = user_name();
  const auto started = ask_daemon(*socket, task);
  if (!started) return report(started.error());
  return options.detach ? 0 : follow(*socket, method, options.json);
}

}  // namespace abbe::daemon
