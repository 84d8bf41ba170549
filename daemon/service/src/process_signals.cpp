#include "abbe/service/process_signals.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <string_view>

#include "abbe/base/standard_error.hpp"
#include "abbe/drivers/emergency_stop.hpp"

namespace abbe::daemon {
namespace {

constexpr std::chrono::milliseconds kAbortAnswer{500};
constexpr std::chrono::milliseconds kCrashMessageTime{200};

constexpr std::array kEnding{SIGTERM, SIGINT, SIGHUP, SIGQUIT, SIGPWR, SIGXCPU};
constexpr std::array kIgnored{SIGPIPE, SIGUSR1, SIGUSR2,   SIGALRM, SIGVTALRM, SIGPROF,
                              SIGIO,   SIGXFSZ, SIGSTKFLT, SIGTSTP, SIGTTIN,   SIGTTOU};
constexpr std::array kCrashes{SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGSYS, SIGTRAP, SIGABRT};

// The actions that were replaced by the handlers: the default action, or the report of a sanitizer.
std::array<struct sigaction, NSIG> replaced_actions{};
std::atomic_flag crash_is_handled = ATOMIC_FLAG_INIT;

/// The result of the stops as text. The texts are literals, because a signal handler may not
/// allocate.
std::string_view text_of(const drivers::EmergencyStops& stops) noexcept {
  if (stops.not_sent > 0)
    return "abbed: AbortE cannot be sent: there is no connection to the measuring machine; it may "
           "be moving\n";
  if (stops.sent == 0) return {};
  if (stops.confirmed == stops.sent)
    return "abbed: AbortE was sent to the measuring machine, which answered it\n";
  return "abbed: AbortE was sent to the measuring machine, which has not answered it: it may be "
         "moving\n";
}

void write_now(std::string_view text) noexcept {
  write_within(STDERR_FILENO, text, kCrashMessageTime);
}

/// The handler for crashes. Async-signal-safe. The signal is blocked while the handler runs. After
/// the handler the replaced action applies, because the fault happens again, or because raise() has
/// left a pending signal.
void stop_machines_and_crash(int number) {
  if (crash_is_handled.test_and_set())
    // another thread crashed as well: the thread that crashed first ends the process
    for (;;) ::pause();

  const auto stops = drivers::send_emergency_stops(kAbortAnswer);
  write_now("abbed: internal error: ended by ");
  write_now(::sigdescr_np(number));
  write_now("; a restart stops a machine that moved, and awaits its release\n");
  write_now(text_of(stops));
  ::sigaction(number, &replaced_actions.at(static_cast<std::size_t>(number)), nullptr);
  ::raise(number);
}

/// Writes the text of the exception; afterwards SIGABRT follows.
[[noreturn]] void on_terminate() noexcept {
  try {
    if (const auto thrown = std::current_exception()) std::rethrow_exception(thrown);
    write_now("abbed: internal error: std::terminate()\n");
  } catch (const std::exception& error) {
    write_now("abbed: internal error: uncaught exception: ");
    write_now(error.what());
    write_now("\n");
  } catch (...) {
    write_now("abbed: internal error: uncaught exception\n");
  }
  std::abort();
}

void handle_crashes() {
  struct sigaction action {};
  action.sa_handler = &stop_machines_and_crash;
  action.sa_flags = SA_ONSTACK;
  ::sigfillset(&action.sa_mask);
  for (const int number : kCrashes)
    ::sigaction(number, &action, &replaced_actions.at(static_cast<std::size_t>(number)));
  std::set_terminate(&on_terminate);
}

}  // namespace

sigset_t prepare_signals() {
  for (const int number : kIgnored) ::signal(number, SIG_IGN);
  for (int number = SIGRTMIN; number <= SIGRTMAX; ++number) ::signal(number, SIG_IGN);
  handle_crashes();

  sigset_t ending;
  ::sigemptyset(&ending);
  for (const int number : kEnding) ::sigaddset(&ending, number);
  ::pthread_sigmask(SIG_BLOCK, &ending, nullptr);
  return ending;
}

std::string stop_machines_at_once() noexcept {
  return std::string{text_of(drivers::send_emergency_stops(kAbortAnswer))};
}

std::string signal_name(int number) {
  const char* const name = ::sigabbrev_np(number);
  return name != nullptr ? fmt::format("SIG{}", name) : fmt::format("signal {}", number);
}

}  // namespace abbe::daemon
