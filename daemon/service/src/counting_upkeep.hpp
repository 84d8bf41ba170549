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
  /// Reads the file. A file that cannot be used is added to `warnings`.
  void read(const Config& config, std::vector<std::string>& warnings);
  /// The state of the previous run, if it can still be valid. Not after start().
  [[nodiscard]] const std::optional<CountingState>& left() const noexcept { return left_.state; }

  /// Starts the thread. `hub` must exist until end().
  void start(const Config& config, Hub& hub);
  /// The hub's thread has ended: the service for reference marks is used without it.
  void hub_ended() noexcept;
  /// Writes the file a last time; waits for the disk, CountingStateThread::kEndTimeout at most.
  void end() { thread_.reset(); }

 private:
  [[nodiscard]] std::optional<CountingState> look(const std::string& set_up, Hub& hub);

  const std::string boot_ = boot_id();
  LeftCounting left_;  // after start(): the thread's
  std::atomic<bool> hub_has_ended_{false};
  std::optional<CountingStateThread> thread_;
};

}  // namespace abbe::daemon
