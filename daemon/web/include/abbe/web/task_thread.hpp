#pragma once
/// Runs long tasks for the page, one at a time, on a thread of the lowest priority. Thread-safe.

#include <functional>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <utility>

#include "abbe/base/error.hpp"

namespace abbe::web {

class TaskThread {
 public:
  /// Returns the outcome: {"state": "done" | "failed", ...}.
  using Work = std::function<nlohmann::json()>;

  /// `what`: "replay", "identification". `report` receives a line for an internal error, on the
  /// thread of the task.
  TaskThread(std::string what, std::function<void(const std::string&)> report)
      : what_(std::move(what)),
        has_failed_("the " + what_ + " has failed"),
        report_(std::move(report)) {}
  TaskThread(const TaskThread&) = delete;
  TaskThread& operator=(const TaskThread&) = delete;
  ~TaskThread();  ///< waits for the task that runs

  /// `subject`: what every status of this task has beside its state. Refused while another one
  /// runs; Io if no thread can be started.
  [[nodiscard]] daemon::Result<void> begin(const nlohmann::json& subject, Work work);
  /// Sets members of the status of the task that runs.
  void update(const nlohmann::json& members);
  [[nodiscard]] bool running() const;
  /// {"state": "none" | "running" | "done" | "failed", ...}
  [[nodiscard]] nlohmann::json status() const;

 private:
  void run(const Work& work, nlohmann::json outcome);

  std::string what_, has_failed_;
  std::function<void(const std::string&)> report_;
  mutable std::mutex mutex_;  // of the members below
  nlohmann::json status_ = {{"state", "none"}};
  bool running_ = false;
  std::thread thread_;
};

}  // namespace abbe::web
