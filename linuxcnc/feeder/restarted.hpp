// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// Runs a function in a child process, which is started again when it ends by a signal or an error,
/// as a service manager would do. This is needed because LinuxCNC starts its user-space programs
/// only once.

#include <functional>
#include <string>

namespace abbe::linuxcnc {

/// Returns the exit code of the child if `is_final` is true for it, or if SIGTERM or SIGINT to this
/// process ended the child. Otherwise the child is started again 0.5 s after its end, and `report`
/// is called with a sentence about it. Call it before any thread is started. The child gets SIGTERM
/// when this process ends in another way.
[[nodiscard]] int run_restarted(const std::function<int()>& run,
                                const std::function<bool(int)>& is_final,
                                const std::function<void(const std::string&)>& report);

}  // namespace abbe::linuxcnc
