#pragma once
/// What every `abbe calibrate METHOD` that runs in the daemon does alike: options, asking,
/// following to the verdict, cancelling.

#include <CLI/App.hpp>
#include <nlohmann/json.hpp>
#include <string>

#include "daemon_socket.hpp"

namespace abbe::daemon {

struct FollowOptions {
  DaemonSocket where;
  bool detach = false;
  bool cancel = false;
  bool json = false;
};

/// --config, --socket, --detach, --cancel, --json. `excluded`: what makes no sense with --cancel.
void add_follow_options(CLI::App& command, FollowOptions& options, CLI::Option* excluded);

/// Ends the calibration that is running; returns the exit code.
int cancel_calibration(const FollowOptions& options);
/// Asks for `task` and, unless detached, follows it: what it waits for, what it noticed, its
/// verdict. Returns the exit code.
int run_calibration(const FollowOptions& options, nlohmann::json task);

}  // namespace abbe::daemon
