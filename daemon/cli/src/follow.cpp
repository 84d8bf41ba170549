#include "follow.hpp"

#include <fmt/format.h>

#include <chrono>
#include <csignal>
#include <thread>

#include "abbe/base/control_protocol.hpp"
#include "abbe/base/exit_codes.hpp"
#include "daemon_socket.hpp"
#include "interruption.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;

constexpr auto kStatusPollPeriod = 200ms;  // also the period of the progress bar

int print_how_to_cancel(const Following& following) {
  static_assert(number(ExitCode::Interrupted) == 128 + SIGINT);
  if (following.cancel.empty()) {
    fmt::print(stderr, "abbe: {} continues; no command ends it\n", following.what);
  } else {
    fmt::print(stderr, "abbe: {} continues; to end it: {} --socket {}\n", following.what,
               following.cancel, following.socket.string());
  }
  return number(ExitCode::Interrupted);
}

/// Detects a restart of the daemon: compares the process id in each status with that in the first.
class SameDaemon {  // NOLINT(bugprone-exception-escape): an empty json throws nothing
 public:
  bool is(const json& status) {
    const auto process = status.value("process", json{});
    if (first_.is_null()) first_ = process;
    return process == first_;
  }

 private:
  json first_;
};

}  // namespace

int follow(const Following& following, ProgressBar& bar) {
  mark_interruptions({SIGINT});
  SameDaemon same;
  auto answered = std::chrono::steady_clock::now();

  for (;; std::this_thread::sleep_for(kStatusPollPeriod)) {
    if (interrupted()) {
      bar.clear();
      return print_how_to_cancel(following);
    }

    const auto status = ask_daemon(following.socket, {{"do", "status"}});
    const auto now = std::chrono::steady_clock::now();
    if (!status && now - answered < kDaemonTimeout) continue;

    if (!status || !same.is(*status)) {
      bar.clear();
      return report(
          status ? Error{ErrorCode::Io,
                         fmt::format("{} is lost: the daemon restarted; run the command again",
                                     following.what)}
                 : status.error());
    }

    answered = now;
    if (const auto exit = following.look(*status)) return *exit;
  }
}

}  // namespace abbe::daemon
