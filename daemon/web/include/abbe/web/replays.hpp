#pragma once
/// Replays a recording for the page as `abbe replay` does: one at a time, on a thread of low
/// priority, within limits. It reads the recording and writes nothing. Thread-safe.

#include <atomic>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "abbe/base/error.hpp"
#include "abbe/web/task_limits.hpp"
#include "abbe/web/task_thread.hpp"

namespace abbe::web {

class Replays {
 public:
  /// `report` receives a line for an internal error, on the thread of the replay.
  Replays(std::filesystem::path recordings, std::function<void(const std::string&)> report,
          TaskLimits limits = {})
      : folder_(std::move(recordings)), limits_(limits), thread_("replay", std::move(report)) {}
  Replays(const Replays&) = delete;
  Replays& operator=(const Replays&) = delete;
  ~Replays() { stop(); }  ///< ends a running replay and waits for that

  /// Refused while another replay runs; Usage or Io if there is no such recording.
  [[nodiscard]] daemon::Result<void> begin(const std::string& name);
  /// Lets a running replay, and every later one, fail soon. Does not wait.
  void stop() noexcept { stopping_ = true; }
  [[nodiscard]] bool running() const { return thread_.running(); }
  /// {"state": "none" | "running" | "done" | "failed", "name", "result": what `abbe replay --json`
  /// prints, "error": TEXT}.
  [[nodiscard]] nlohmann::json status() const { return thread_.status(); }

 private:
  [[nodiscard]] nlohmann::json outcome_of(const std::string& name) const;

  std::filesystem::path folder_;
  TaskLimits limits_;
  std::atomic<bool> stopping_{false};
  TaskThread thread_;  // last: it uses the members above
};

}  // namespace abbe::web
