#pragma once
/// An ordinary thread that keeps DATA_DIR/counting-state.json: looks once a second, writes when the
/// datum of an axis changed, else every 5 s, and at the end. A disk that hangs holds up nothing but
/// this thread, and not the end: a thread that still waits for it after kEndTimeout is left
/// running, see background_tasks_running().

#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include "abbe/pipeline/counting_state.hpp"

namespace abbe::daemon {

class CountingStateThread {
 public:
  static constexpr std::chrono::seconds kEndTimeout{3};

  /// `look` runs on the new thread; nothing: the file stays as it is. `report` gets each new fault
  /// of the file once, on the new thread, too; a disk that does not answer at the end on the thread
  /// that destroys this. Neither is called after the end.
  CountingStateThread(std::filesystem::path file,
                      std::function<std::optional<CountingState>()> look,
                      std::function<void(const std::string&)> report,
                      std::chrono::milliseconds period = std::chrono::seconds{1});
  ~CountingStateThread();  ///< looks and writes once more, within kEndTimeout
  CountingStateThread(const CountingStateThread&) = delete;
  CountingStateThread& operator=(const CountingStateThread&) = delete;

 private:
  struct Work;
  std::shared_ptr<Work> work_;  // with the thread, which may outlive this
  std::thread thread_;
};

}  // namespace abbe::daemon
