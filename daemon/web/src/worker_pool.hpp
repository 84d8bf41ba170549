#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

#include "http.hpp"

namespace abbe::web {

/// The threads that serve connections, one each. A connection for which no thread is free waits; at
/// kMostWaiting the server accepts no further ones until a thread is free, and `full` is called.
class WorkerPool final : public httplib::TaskQueue {
 public:
  static constexpr std::size_t kMostWaiting = 64;

  WorkerPool(std::size_t threads, std::function<void()> full);
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;
  ~WorkerPool() override = default;

  void enqueue(std::function<void()> serve) override;
  void shutdown() override;

 private:
  void work();

  std::function<void()> full_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::function<void()>> waiting_;
  bool stopping_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace abbe::web
