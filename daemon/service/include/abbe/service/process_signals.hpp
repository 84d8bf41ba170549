#pragma once
/// What signals and uncaught exceptions do to abbed. The rule: nothing that can be caught ends
/// abbed while a measuring machine moves without AbortE.
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
/// the answer. A line for stderr about each of them; empty: none moves. For an end that cannot wait
/// for the device threads.
[[nodiscard]] std::string stop_machines_at_once() noexcept;

/// "SIGHUP"
[[nodiscard]] std::string signal_name(int number);

}  // namespace abbe::daemon
