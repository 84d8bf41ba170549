#pragma once
/// Replays a recording for the page as `abbe replay` does: one at a time, on a thread of low
/// priority, within limits. It reads the recording and writes nothing. Thread-safe.

#include <atomic>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <utility>

#include "abbe/base/error.hpp"

namespace abbe::web {

/// A replay that exceeds one of them ends and has failed, at the latest when the identification
/// with a bar or an array that is under way has ended.
struct ReplayLimits {
  std::chrono::minutes time{60};
  /// Resident memory of the whole process, looked at between the steps of a replay: far below
  /// MemoryMax of abbe-web.service, so that a replay ends before the kernel ends abbe-web.
  std::uint64_t memory_bytes = std::uint64_t{1} << 30;
};

class Replays {
 public:
  /// `report` receives a line for an internal error, on the thread of the replay.
  Replays(std::filesystem::path recordings, std::function<void(const std::string&)> report,
          ReplayLimits limits = {})
      : folder_(std::move(recordings)), report_(std::move(report)), limits_(limits) {}
  Replays(const Replays&) = delete;
  Replays& operator=(const Replays&) = delete;
  ~Replays();  ///< ends a running replay and waits for that

  /// Refused while another replay runs; Usage or Io if there is no such recording.
  [[nodiscard]] daemon::Result<void> begin(const std::string& name);
  /// Lets a running replay, and every later one, fail soon. Does not wait.
  void stop() noexcept { stopping_ = true; }
  /// {"state": "none" | "running" | "done" | "failed", "name", "result": what `abbe replay --json`
  /// prints, "error": TEXT}.
  [[nodiscard]] nlohmann::json status() const;

 private:
  void work(const std::string& name, nlohmann::json failed);
  [[nodiscard]] nlohmann::json outcome_of(const std::string& name) const;
  void end(nlohmann::json outcome);

  std::filesystem::path folder_;
  std::function<void(const std::string&)> report_;
  ReplayLimits limits_;
  std::atomic<bool> stopping_{false};
  mutable std::mutex mutex_;  // of the members below
  nlohmann::json status_ = {{"state", "none"}};
  bool running_ = false;
  std::thread thread_;
};

}  // namespace abbe::web
