#include "worker_pool.hpp"

#include <fmt/format.h>

#include <exception>
#include <system_error>
#include <utility>

#include "internal_error.hpp"

namespace abbe::web {

daemon::Result<std::unique_ptr<WorkerPool>> WorkerPool::start(
    std::size_t threads, std::function<void(const std::string&)> report) {
  std::unique_ptr<WorkerPool> pool{new WorkerPool(std::move(report))};  // NOLINT: private
  pool->threads_.reserve(threads);
  try {
    for (std::size_t i = 0; i < threads; ++i)
      pool->threads_.emplace_back([&of = *pool] { of.work(); });
  } catch (const std::system_error& error) {
    return daemon::fail(
        daemon::ErrorCode::Io,
        fmt::format("start {} threads for connections: {} (TasksMax= of the unit, or the limit of "
                    "processes of the user)",
                    threads, error.code().message()));
  }
  return pool;
}

WorkerPool::~WorkerPool() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

bool WorkerPool::enqueue(Serve serve) {
  {
    const std::lock_guard lock(mutex_);
    // A free thread may not have taken its connection yet.
    if (served_ + waiting_.size() >= threads_.size() + kMostWaiting) return false;
    waiting_.push_back({std::move(serve), Clock::now()});
  }
  changed_.notify_one();
  return true;
}

std::chrono::nanoseconds WorkerPool::longest_wait(Clock::time_point now) const {
  const std::lock_guard lock(mutex_);
  if (waiting_.empty()) return {};
  return now - waiting_.front().since;
}

/// Serves until the pool ends and no connection waits.
void WorkerPool::work() {
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [this] { return stopping_ || !waiting_.empty(); });
    if (waiting_.empty()) return;
    Waiting next = std::move(waiting_.front());
    waiting_.pop_front();
    ++served_;
    lock.unlock();
    serve(std::move(next.serve));
    lock.lock();
    --served_;
  }
}

/// A connection that throws, for example because memory is short, ends; its thread does not.
void WorkerPool::serve(Serve task) {  // NOLINT: ends with the call, before the lock is taken
  try {
    task(*this);
  } catch (const std::exception& error) {
    report_internal_error(report_, error.what(), "the connection is closed");
  } catch (...) {
    report_internal_error(report_, "not a std::exception", "the connection is closed");
  }
}

}  // namespace abbe::web
