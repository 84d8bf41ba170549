#pragma once
/// How abbed handles signals and uncaught exceptions. The rule: if a signal or exception that can
/// be caught ends abbed while a measuring machine moves, abbed sends AbortE first.
///
/// | | |
/// | --- | --- |
/// | SIGTERM, SIGINT, SIGHUP, SIGQUIT, SIGPWR, SIGXCPU | end abbed in order |
/// | SIGPIPE, SIGUSR1, SIGUSR2, SIGALRM, SIGVTALRM, SIGPROF, SIGIO, SIGSTKFLT, SIGXFSZ, real-time signals | ignored |
/// | SIGTSTP, SIGTTIN, SIGTTOU | ignored: a suspended abbed would no longer supervise the machine |
/// | SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGSYS, SIGTRAP, SIGABRT (also the watchdog of systemd, std::terminate()) | AbortE, a message, then the signal's own end (core file) |
/// | SIGKILL, SIGSTOP | cannot be caught |

#include <signal.h>

#include <string>

namespace abbe::daemon {

/// Call it in main() before other threads are started. Blocks the signals that end abbed in order,
/// in this thread and in those that it starts, and returns them for sigtimedwait(). Ignores others
/// and installs handlers for crashes.
[[nodiscard]] sigset_t prepare_signals();

/// Sends AbortE to every machine that moves, without its device thread, and waits at most 0.5 s for
/// the answer. Returns a line for stderr about each of them; empty: none moves. Used when the
/// process ends without waiting for the device threads.
[[nodiscard]] std::string stop_machines_at_once() noexcept;

/// The name of the signal: "SIGHUP".
[[nodiscard]] std::string signal_name(int number);

}  // namespace abbe::daemon
