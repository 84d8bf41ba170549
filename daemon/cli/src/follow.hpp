#pragma once
/// Follows a task of the daemon until it has ended. Used for calibrations, the search for reference
/// marks and orders to a tracker.

#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "terminal.hpp"

namespace abbe::daemon {

struct Following {
  std::filesystem::path socket;
  std::string what;    ///< "the calibration": the task in messages to the user
  std::string cancel;  ///< the command that ends the task; empty: there is none
  /// Called with the answer to "status". Prints the progress. Once the task has ended, prints its
  /// result and returns the exit code; nullopt before that.
  std::function<std::optional<int>(const nlohmann::json& status)> look;
};

/// Requests the status periodically until `look` returns an exit code. Ctrl-C ends this function
/// (exit code 130), but not the task of the daemon. Io if the daemon does not answer for 5 s, or
/// has restarted, because the task is lost then.
[[nodiscard]] int follow(const Following& following, ProgressBar& bar);

}  // namespace abbe::daemon
