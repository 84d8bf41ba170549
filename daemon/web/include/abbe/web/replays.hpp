#pragma once
/// Replays a recording for the page: one `abbe replay NAME --json` at a time, as a child process of
/// low priority. Thread-safe.

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>

#include "abbe/base/error.hpp"

namespace abbe::web {

class Replays {
 public:
  Replays(std::filesystem::path abbe_program, std::filesystem::path recordings)
      : program_(std::move(abbe_program)), folder_(std::move(recordings)) {}
  Replays(const Replays&) = delete;
  Replays& operator=(const Replays&) = delete;
  ~Replays();  ///< ends a running replay

  /// Refused while another replay runs; Usage or Io if there is no such recording.
  [[nodiscard]] daemon::Result<void> begin(const std::string& name);
  /// {"state": "none" | "running" | "done" | "failed", "name", "result": what `abbe replay --json`
  /// printed, "error": TEXT}.
  [[nodiscard]] nlohmann::json status() const;

 private:
  void follow(int output_fd, pid_t child);

  std::filesystem::path program_, folder_;
  mutable std::mutex mutex_;  // of the members below
  nlohmann::json status_ = {{"state", "none"}};
  pid_t child_ = 0;  ///< 0: none
  std::thread thread_;
};

}  // namespace abbe::web
