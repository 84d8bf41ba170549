#pragma once
/// Output to stderr that never waits for the reader. A write to a stopped terminal, to a `tee` that
/// hangs or to a pipe that no process reads would block. A program that serves clients or must stop
/// a machine could then neither run nor end.

#include <chrono>
#include <cstddef>
#include <string>
#include <string_view>

namespace abbe::daemon {

/// Most bytes of messages that wait to be written.
inline constexpr std::size_t kMostWaitingStderr = std::size_t{256} * 1024;

/// Call it once, in main(), before other threads are started. `program`: the name in the message
/// about lost messages. Also ignores SIGPIPE: a write to a closed pipe fails instead of ending the
/// process. At the end of main(), or in exit(), drain_stderr() is called.
void unblock_stderr(std::string program);

/// Waits until the messages written so far are out, at most `at_most`. Call it before _exit() and
/// exec(). Without an earlier unblock_stderr() it returns at once.
void drain_stderr(std::chrono::milliseconds at_most = std::chrono::milliseconds{500});

/// Writes to a descriptor and waits at most `at_most` in total for space. Meant for a process that
/// ends: it is async-signal-safe, takes no lock, and does not use the thread of unblock_stderr().
/// Returns false if not everything was written.
bool write_within(int fd, std::string_view text, std::chrono::milliseconds at_most) noexcept;

}  // namespace abbe::daemon
