#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "abbe/base/error.hpp"

namespace abbe::web {

/// The threads that serve connections, one each. A connection for which no thread is free waits.
class WorkerPool {
 public:
  using Clock = std::chrono::steady_clock;
  /// Serves a connection; gets the pool, whose longest_wait() tells whether others wait.
  using Serve = std::function<void(const WorkerPool&)>;
  static constexpr std::size_t kMostWaiting = 64;

  /// Io if the threads cannot be created. `report` receives a line for each task that throws; any
  /// thread.
  [[nodiscard]] static daemon::Result<std::unique_ptr<WorkerPool>> start(
      std::size_t threads, std::function<void(const std::string&)> report);
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;
  /// Serves the connections that wait, and ends the threads.
  ~WorkerPool();

  /// False if each thread has a connection and kMostWaiting others wait; `serve` is then not
  /// called.
  [[nodiscard]] bool enqueue(Serve serve);
  /// How long the connection that waits longest has waited; 0: none waits.
  [[nodiscard]] std::chrono::nanoseconds longest_wait(Clock::time_point now) const;

 private:
  struct Waiting {
    Serve serve;
    Clock::time_point since;
  };

  explicit WorkerPool(std::function<void(const std::string&)> report)
      : report_(std::move(report)) {}
  void work();
  void serve(Serve task);

  std::function<void(const std::string&)> report_;
  mutable std::mutex mutex_;  // of the members below
  std::condition_variable changed_;
  std::deque<Waiting> waiting_;
  std::size_t served_ = 0;  // connections that a thread serves
  bool stopping_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace abbe::web
