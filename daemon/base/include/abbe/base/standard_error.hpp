#pragma once
/// Output to stderr that never waits for whoever reads it. A terminal that is stopped, a `tee` that
/// hangs, a pipe that nobody reads: a write to it blocks, and would keep a program that serves
/// something, or that must stop a machine, from running and from ending.
///
/// After unblock_stderr() everything that this process writes to `stderr`, std::cerr and std::clog
/// passes through memory to a thread that writes it. What does not fit is dropped, and the number
/// of lost messages is written later. O_NONBLOCK is not used: it would also apply to the other
/// processes at the same terminal or pipe. Child processes inherit the original descriptor.

#include <chrono>
#include <cstddef>
#include <string>
#include <string_view>

namespace abbe::daemon {

/// Bytes of messages that wait to be written.
inline constexpr std::size_t kMostWaitingStderr = std::size_t{256} * 1024;

/// Call it once, in main(), before other threads are started. `program`: the name in the message
/// about lost messages. Also ignores SIGPIPE: a write to a closed pipe fails instead of ending the
/// process. At the end of main(), or in exit(), drain_stderr() is called.
void unblock_stderr(std::string program);

/// Waits until the messages written before are out, at most `at_most`. Call it before _exit() and
/// exec(). Returns at once without unblock_stderr().
void drain_stderr(std::chrono::milliseconds at_most = std::chrono::milliseconds{500});

/// Writes to a descriptor, but waits at most `at_most` in total for space. For a process that ends:
/// async-signal-safe, takes no lock, and does not use the thread of unblock_stderr(). False: not
/// everything was written.
bool write_within(int fd, std::string_view text, std::chrono::milliseconds at_most) noexcept;

}  // namespace abbe::daemon
