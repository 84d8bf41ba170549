#include "long_requests.hpp"

#include <unistd.h>

#include <utility>

namespace abbe::daemon {

LongRequests::LongRequests(Answer answer, int done_fd)
    : answer_(std::move(answer)), done_fd_(done_fd), thread_([this] { run(); }) {}

LongRequests::~LongRequests() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_one();
  thread_.join();
}

bool LongRequests::take(std::uint64_t client, std::string line, ControlPeer peer) {
  {
    const std::lock_guard lock(mutex_);
    if (waiting_.size() >= kMostWaiting) return false;
    waiting_.push_back({client, std::move(line), std::move(peer)});
  }
  changed_.notify_one();
  return true;
}

void LongRequests::forget(std::uint64_t client) {
  const std::lock_guard lock(mutex_);
  std::erase_if(waiting_, [client](const Job& w) { return w.client == client; });
}

std::list<LongRequests::Job> LongRequests::answered() {
  const std::lock_guard lock(mutex_);
  return std::exchange(answered_, {});
}

void LongRequests::run() {
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [this] { return stopping_ || !waiting_.empty(); });
    if (stopping_) return;
    std::list<Job> next;
    next.splice(next.end(), waiting_, waiting_.begin());
    lock.unlock();
    next.front().line = answer_(next.front().line, next.front().peer);
    lock.lock();
    answered_.splice(answered_.end(), next);
    const std::uint64_t one = 1;
    (void)!::write(done_fd_, &one, sizeof one);
  }
}

}  // namespace abbe::daemon
