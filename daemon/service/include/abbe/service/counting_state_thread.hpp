#pragma once
/// An ordinary thread that writes DATA_DIR/counting-state.json. It reads the state once a second
/// and writes the file when the zero of an axis changed, else every 5 s, and at the end. A disk
/// that does not answer blocks only this thread, and not the end of the daemon: a thread that still
/// waits for the disk after kEndTimeout is left running, see background_tasks_running().

#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include "abbe/base/end_limits.hpp"
#include "abbe/pipeline/counting_state.hpp"

namespace abbe::daemon {

class CountingStateThread {
 public:
  static constexpr std::chrono::seconds kEndTimeout = kLongestCountingEnd;

  /// `look` returns the state to write and is called on the new thread; if it returns nullopt, the
  /// file is not changed. `report` is called once for each new fault of the file, also on the new
  /// thread. If the disk does not answer at the end, the destructor calls `report` on the
  /// destructor's thread. Neither function is called after the destructor has returned.
  CountingStateThread(std::filesystem::path file,
                      std::function<std::optional<CountingState>()> look,
                      std::function<void(const std::string&)> report,
                      std::chrono::milliseconds period = std::chrono::seconds{1});
  ~CountingStateThread();  ///< reads the state and writes the file a last time; see kEndTimeout
  CountingStateThread(const CountingStateThread&) = delete;
  CountingStateThread& operator=(const CountingStateThread&) = delete;

 private:
  struct Work;
  std::shared_ptr<Work> work_;  // shared with the thread, which may outlive this object
  std::thread thread_;
};

}  // namespace abbe::daemon
