// SPDX-License-Identifier: GPL-2.0-or-later
#include "restarted.hpp"

#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <ctime>

namespace abbe::linuxcnc {
namespace {

constexpr timespec kPause{0, 500'000'000};

/// Runs the function in the child process. Never returns.
[[noreturn]] void run_child(const std::function<int()>& run, const sigset_t& unblocked,
                            pid_t parent) {
  ::prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (::getppid() != parent) std::_Exit(EXIT_SUCCESS);  // the parent ended before prctl()
  ::sigprocmask(SIG_SETMASK, &unblocked, nullptr);
  std::exit(run());
}

/// Waits for the end of the child and forwards SIGTERM and SIGINT to it.
int wait_for(pid_t child, const sigset_t& awaited, bool& stopped) {
  for (;;) {
    int status = 0;
    const pid_t ended = ::waitpid(child, &status, WNOHANG);
    if (ended == child || (ended < 0 && errno != EINTR)) return status;
    const int signal = ::sigwaitinfo(&awaited, nullptr);
    if (signal != SIGTERM && signal != SIGINT) continue;
    stopped = true;
    ::kill(child, SIGTERM);
  }
}

std::string described(int status) {
  return WIFSIGNALED(status) ? std::string("ended by signal ") + std::to_string(WTERMSIG(status)) +
                                   " (" + ::strsignal(WTERMSIG(status)) + ")"
                             : "ended with exit code " + std::to_string(WEXITSTATUS(status));
}

}  // namespace

int run_restarted(const std::function<int()>& run, const std::function<bool(int)>& is_final,
                  const std::function<void(const std::string&)>& report) {
  sigset_t awaited, unblocked, stopping;
  ::sigemptyset(&stopping);
  for (const int signal : {SIGTERM, SIGINT}) ::sigaddset(&stopping, signal);
  awaited = stopping;
  ::sigaddset(&awaited, SIGCHLD);
  ::sigprocmask(SIG_BLOCK, &awaited, &unblocked);
  const pid_t parent = ::getpid();

  for (bool stopped = false;;) {
    const pid_t child = ::fork();
    if (child == 0) run_child(run, unblocked, parent);
    if (child > 0) {
      const int status = wait_for(child, awaited, stopped);
      const int code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
      if (stopped || (WIFEXITED(status) && is_final(code))) return code;
      report(described(status) + "; it is started again in 0.5 s");
    } else {
      report(std::string("cannot be started: ") + std::strerror(errno) + "; again in 0.5 s");
    }
    if (::sigtimedwait(&stopping, nullptr, &kPause) > 0) return EXIT_SUCCESS;
  }
}

}  // namespace abbe::linuxcnc
