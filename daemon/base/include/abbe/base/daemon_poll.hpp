#pragma once
/// Asks abbed for its status once a second on a separate thread, so that an abbed that does not
/// answer does not delay the other work of the process. Used by abbe-mtconnect and abbe-notify.

#include <chrono>
#include <condition_variable>
#include <filesystem>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <thread>

#include "abbe/base/error.hpp"
#include "abbe/base/file_descriptor.hpp"

namespace abbe::daemon {

class DaemonPoll {
 public:
  using Answer = Result<nlohmann::json>;

  explicit DaemonPoll(std::filesystem::path control_socket,
                      std::chrono::milliseconds period = std::chrono::seconds{1});
  DaemonPoll(const DaemonPoll&) = delete;
  DaemonPoll& operator=(const DaemonPoll&) = delete;
  ~DaemonPoll();  ///< waits for the end of a request, at most a few seconds

  /// This descriptor becomes readable when take() has an answer.
  [[nodiscard]] int wake_fd() const noexcept { return wake_.get(); }
  /// The latest answer, returned once; nullopt if there is no new one; an Error if abbed did not
  /// answer. Any thread.
  [[nodiscard]] std::optional<Answer> take();

 private:
  void run();

  std::filesystem::path socket_;
  std::chrono::milliseconds period_;
  FileDescriptor wake_;
  std::mutex mutex_;
  std::condition_variable stop_requested_;
  bool stopping_ = false;
  std::optional<Answer> answer_;
  std::thread thread_;
};

}  // namespace abbe::daemon
