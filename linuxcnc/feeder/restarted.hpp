// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// Runs a function in a child process that is started again when it ends by a signal or an error,
/// as a service manager does: LinuxCNC starts its user-space programs once.

#include <functional>
#include <string>

namespace abbe::linuxcnc {

/// Returns the exit code of the child that ended with a code that `is_final`, or that SIGTERM or
/// SIGINT to this process ended. The child is started again 0.5 s after it ended otherwise;
/// `report` takes a sentence about it. Call it before any thread is started. The child gets SIGTERM
/// when this process ends in another way.
[[nodiscard]] int run_restarted(const std::function<int()>& run,
                                const std::function<bool(int)>& is_final,
                                const std::function<void(const std::string&)>& report);

}  // namespace abbe::linuxcnc
