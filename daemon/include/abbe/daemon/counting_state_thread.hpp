#pragma once
/// An ordinary thread that keeps DATA_DIR/counting-state.json: looks once a second, writes when the datum of
/// an axis changed, else every 5 s, and at the end. A disk that hangs holds up nothing but this thread.

#include <chrono>
#include <condition_variable>
#include <filesystem>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "abbe/daemon/counting_state.hpp"

namespace abbe::daemon {

class CountingStateThread {
 public:
  using Clock = std::chrono::steady_clock;

  /// `look` runs on the new thread; nothing: the file stays as it is. `report` gets each new fault of the
  /// file once, on the new thread, too.
  CountingStateThread(std::filesystem::path file, std::function<std::optional<CountingState>()> look,
                      std::function<void(const std::string&)> report,
                      std::chrono::milliseconds period = std::chrono::seconds{1});
  ~CountingStateThread();  ///< looks and writes once more
  CountingStateThread(const CountingStateThread&) = delete;
  CountingStateThread& operator=(const CountingStateThread&) = delete;

 private:
  void run();
  void look(bool last);
  void write(const CountingState& state);

  std::filesystem::path file_;
  std::function<std::optional<CountingState>()> look_;
  std::function<void(const std::string&)> report_;
  std::chrono::milliseconds period_;
  std::optional<CountingState> written_;
  Clock::time_point written_at_{};
  std::string fault_;
  std::mutex mutex_;
  std::condition_variable wake_;
  bool stopping_ = false;  // under mutex_
  std::thread thread_;
};

}  // namespace abbe::daemon
