#include "follow.hpp"

#include <fmt/format.h>

#include <chrono>
#include <csignal>
#include <thread>

#include "abbe/base/control_protocol.hpp"
#include "daemon_socket.hpp"
#include "interruption.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;

constexpr auto kLook = 200ms;  // how often a person's progress bar moves

int say_how_to_cancel(const Following& following) {
  constexpr int kInterrupted = 128 + SIGINT;  // what a shell reports
  if (following.cancel.empty()) {
    fmt::print(stderr, "abbe: {} goes on; no command ends it\n", following.what);
  } else {
    fmt::print(stderr, "abbe: {} goes on; end it with: {} --socket {}\n", following.what,
               following.cancel, following.socket.string());
  }
  return kInterrupted;
}

/// Whether it is still the daemon that was asked first.
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

  for (;; std::this_thread::sleep_for(kLook)) {
    if (interrupted()) {
      bar.clear();
      return say_how_to_cancel(following);
    }

    const auto status = ask_daemon(following.socket, {{"do", "status"}});
    const auto now = std::chrono::steady_clock::now();
    if (!status && now - answered < kPatienceWithoutDaemon) continue;

    if (!status || !same.is(*status)) {
      bar.clear();
      return report(
          status ? Error{ErrorCode::Io,
                         fmt::format("{} is lost: the daemon was started anew", following.what)}
                 : status.error());
    }

    answered = now;
    if (const auto exit = following.look(*status)) return *exit;
  }
}

}  // namespace abbe::daemon
