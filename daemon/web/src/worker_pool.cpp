#include "worker_pool.hpp"

#include <utility>

namespace abbe::web {

WorkerPool::WorkerPool(std::size_t threads, std::function<void()> full) : full_(std::move(full)) {
  threads_.reserve(threads);
  for (std::size_t i = 0; i < threads; ++i) threads_.emplace_back([this] { work(); });
}

void WorkerPool::enqueue(std::function<void()> serve) {
  std::unique_lock lock(mutex_);
  if (waiting_.size() >= kMostWaiting) {
    full_();
    changed_.wait(lock, [this] { return stopping_ || waiting_.size() < kMostWaiting; });
  }
  waiting_.push_back(std::move(serve));
  changed_.notify_all();
}

void WorkerPool::shutdown() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

/// Serves until shutdown() was called and no connection waits.
void WorkerPool::work() {
  for (;;) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return stopping_ || !waiting_.empty(); });
    if (waiting_.empty()) return;
    const auto serve = std::move(waiting_.front());
    waiting_.pop_front();
    changed_.notify_all();
    lock.unlock();
    serve();
  }
}

}  // namespace abbe::web
