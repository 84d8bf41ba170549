#pragma once
/// Identifies a recorded run again for the page as `abbe identify METHOD --recording` does: one at
/// a time, on a thread of low priority, within limits. It reads the recording, the configuration
/// and the active model, with which the gate compares, and writes nothing. The result stays in
/// memory until the next one. Thread-safe.

#include <atomic>
#include <filesystem>
#include <functional>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "abbe/base/error.hpp"
#include "abbe/web/task_limits.hpp"
#include "abbe/web/task_thread.hpp"

namespace abbe::web {

/// Where an identification reads.
struct IdentificationFiles {
  std::filesystem::path recordings, models, config_file;
};

/// A model that was identified.
struct IdentifiedModel {
  std::string id, text;  ///< text of model.json, with the verdict
  std::string from;      ///< recording and options, for the record of the store
};

class Identifications {
 public:
  /// `report` receives a line for an internal error, on the thread of the identification.
  Identifications(IdentificationFiles files, std::function<void(const std::string&)> report,
                  TaskLimits limits = {})
      : files_(std::move(files)), limits_(limits), thread_("identification", std::move(report)) {}
  Identifications(const Identifications&) = delete;
  Identifications& operator=(const Identifications&) = delete;
  ~Identifications() { stop(); }  ///< ends a running identification and waits for that

  /// `body`: identification_request(). Refused while another identification runs; Usage or Io if
  /// there is no such recording. `user`: who accepts the conditions of the gate that are named.
  [[nodiscard]] daemon::Result<void> begin(const nlohmann::json& body, const std::string& user);
  /// Lets the running identification fail soon. Refused if none runs.
  [[nodiscard]] daemon::Result<void> cancel(const std::string& user);
  /// Lets a running identification, and every later one, fail soon. Does not wait.
  void stop() noexcept { stopping_ = true; }
  [[nodiscard]] bool running() const { return thread_.running(); }
  /// {"state": "none" | "running" | "done" | "failed", "name", "method", "options": [TEXT, ...],
  /// "user"}; while it runs "step" and "progress", 0 to 1; then "error": TEXT, or "result": {"id",
  /// "accepted", "reasons", "notes", "figures", "simulated", "added": whether it is in the store}.
  [[nodiscard]] nlohmann::json status() const;

  /// The last model. Refused if there is none, or if it is not `id`, the one that the page shows;
  /// empty: any.
  [[nodiscard]] daemon::Result<IdentifiedModel> model(const std::string& id = {}) const;
  /// The store has model `id`.
  void note_added(const std::string& id);

 private:
  struct Task;
  [[nodiscard]] nlohmann::json outcome_of(const Task& task);
  [[nodiscard]] std::string end_wanted() const;

  IdentificationFiles files_;
  TaskLimits limits_;
  std::atomic<bool> stopping_{false};
  mutable std::mutex mutex_;  // of the members below
  std::string cancelled_by_;
  IdentifiedModel last_;
  std::string added_;  // id
  TaskThread thread_;  // last: it uses the members above
};

}  // namespace abbe::web
