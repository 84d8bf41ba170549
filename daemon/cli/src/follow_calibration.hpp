#pragma once
/// The common part of every `abbe calibrate METHOD` that runs in the daemon: the options, sending
/// the request, following it to the verdict, and cancelling.

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

/// Adds --config, --socket, --detach, --cancel, --json. `excluded`: the option that cannot be
/// combined with --cancel.
void add_follow_options(CLI::App& command, FollowOptions& options, CLI::Option* excluded);

/// Ends the running calibration; returns the exit code.
int cancel_calibration(const FollowOptions& options);
/// Requests `task` from the daemon and, unless detached, follows it: prints the next step, the
/// notes and the verdict. Returns the exit code.
int run_calibration(const FollowOptions& options, nlohmann::json task);

}  // namespace abbe::daemon
