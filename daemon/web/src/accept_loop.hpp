#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <mutex>
#include <string>
#include <thread>

#include "abbe/base/file_descriptor.hpp"

namespace abbe::web {

/// Accepts connections on a thread of its own. The loop of httplib 0.11 closes its socket after an
/// error that passes, for example ENFILE, and then waits for its open connections: the server
/// cannot be reached, and does not end either.
class AcceptLoop {
 public:
  using Clock = std::chrono::steady_clock;
  using Take = std::function<void(daemon::FileDescriptor)>;
  using Report = std::function<void(const std::string& subject, const std::string& line)>;

  /// `listener`: a listening socket, which must exist as long as the loop; it becomes non-blocking.
  /// `take` receives each connection, and must not wait. `report`: as of LimitedLog. Throws
  /// std::system_error if the thread cannot be created.
  AcceptLoop(int listener, Take take, Report report);
  AcceptLoop(const AcceptLoop&) = delete;
  AcceptLoop& operator=(const AcceptLoop&) = delete;
  ~AcceptLoop();

  /// Why no connection is accepted; empty: connections are accepted. Any thread.
  [[nodiscard]] std::string fault(Clock::time_point now) const;
  /// True if the socket cannot be used any more: only a new start helps. Any thread.
  [[nodiscard]] bool ended() const noexcept { return ended_; }

 private:
  void run();
  void cycle();
  void accept_failed(int error);
  void wait_failed(int error);
  void report_fault(std::string fault);
  void set_fault(std::string fault);

  int listener_;
  Take take_;
  Report report_;
  daemon::FileDescriptor wake_;
  std::atomic<bool> stopping_{false}, ended_{false};
  std::atomic<Clock::time_point> cycled_{Clock::now()};
  mutable std::mutex mutex_;  // of fault_
  std::string fault_;
  std::thread thread_;
};

}  // namespace abbe::web
