#include "abbe/service/journal_thread.hpp"

#include <exception>
#include <utility>

#include "abbe/service/background_tasks.hpp"

namespace abbe::daemon {

JournalThread::JournalThread(std::string machine, std::unique_ptr<JournalSink> sink,
                             std::function<Observed()> look, std::chrono::milliseconds period)
    : observer_(std::move(machine)),
      sink_(std::move(sink)),
      look_(std::move(look)),
      period_(period),
      thread_([this] { run(); }) {}

JournalThread::~JournalThread() {
  {
    const std::lock_guard lock{mutex_};
    stopping_ = true;
  }
  wake_.notify_all();
  thread_.join();
}

void JournalThread::run() {
  become_ordinary_thread();
  std::unique_lock lock{mutex_};
  for (bool last = false; !last;) {
    last = stopping_;
    lock.unlock();
    look();
    lock.lock();
    if (!last) wake_.wait_for(lock, period_, [this] { return stopping_; });
  }
}

void JournalThread::look() {
  try {
    for (const auto& entry : observer_.look(look_(), std::chrono::steady_clock::now()))
      sink_->write(entry);
  } catch (const std::exception& defect) {
    sink_->write({.urgency = Urgency::Error,
                  .message = std::string{"journal: internal error: "} + defect.what(),
                  .message_id = "1f7be2c60d934a58b2c6e9f3a8d50471"});
  }
}

}  // namespace abbe::daemon
