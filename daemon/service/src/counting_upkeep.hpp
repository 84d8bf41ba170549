#pragma once
/// Keeps the state of the counter card over a restart of abbed: reads DATA_DIR/counting-state.json
/// at the start, and has it written by a CountingStateThread. Without counted axes it does nothing.

#include <atomic>
#include <optional>
#include <string>
#include <vector>

#include "abbe/config/config.hpp"
#include "abbe/pipeline/counting_state.hpp"
#include "abbe/service/counting_state_thread.hpp"
#include "abbe/service/hub.hpp"

namespace abbe::daemon {

class CountingUpkeep {
 public:
  /// Reads the file. If it cannot be used, adds a warning to `warnings`.
  void read(const Config& config, std::vector<std::string>& warnings);
  /// The state of the previous run, if it can still be valid. Do not call it after start().
  [[nodiscard]] const std::optional<CountingState>& left() const noexcept { return left_.state; }

  /// Starts the thread. `hub` must exist until end().
  void start(const Config& config, Hub& hub);
  /// Call it when the hub's thread has ended: the reference service is then read without the hub.
  void hub_ended() noexcept;
  /// Writes the file for the last time. Waits for the disk, at most
  /// CountingStateThread::kEndTimeout.
  void end() { thread_.reset(); }

 private:
  [[nodiscard]] std::optional<CountingState> look(const std::string& set_up, Hub& hub);

  const std::string boot_ = boot_id();
  LeftCounting left_;  // after start() it belongs to the thread
  std::atomic<bool> hub_has_ended_{false};
  std::optional<CountingStateThread> thread_;
};

}  // namespace abbe::daemon
