#pragma once
/// Looking on while the daemon works, until it is done: the same for calibrations, the search for
/// reference marks and orders to a tracker.

#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "terminal.hpp"

namespace abbe::daemon {

struct Following {
  std::filesystem::path socket;
  std::string what;    ///< "the calibration": said when somebody stops looking on
  std::string cancel;  ///< the command that would end it; empty: none does
  /// Given the answer to "status": the exit code once it is over, and what came of it said.
  std::function<std::optional<int>(const nlohmann::json& status)> look;
};

/// Asks for the status again and again. Ctrl-C ends the looking on, not the work (exit code 130).
/// Io if the daemon does not answer for 5 s, or is another one than before: what it was doing is
/// lost then.
[[nodiscard]] int follow(const Following& following, ProgressBar& bar);

}  // namespace abbe::daemon
