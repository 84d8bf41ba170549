#include "abbe/web/task_thread.hpp"

#include <fmt/format.h>
#include <malloc.h>
#include <sys/resource.h>

#include <exception>
#include <system_error>

#include "internal_error.hpp"

namespace abbe::web {
namespace {

using daemon::ErrorCode;
using nlohmann::json;

constexpr int kLowPriority = 19;

}  // namespace

TaskThread::~TaskThread() {
  if (thread_.joinable()) thread_.join();
}

daemon::Result<void> TaskThread::begin(const json& subject, Work work) {
  const std::lock_guard lock(mutex_);
  if (running_)
    return daemon::fail(ErrorCode::Refused,
                        fmt::format("another {} is running: wait for it", what_));
  if (thread_.joinable()) thread_.join();

  // Made before memory can be short.
  json failed = subject, running = subject;
  failed.update({{"state", "failed"}, {"error", "internal error: see the log of abbe-web"}});
  running["state"] = "running";
  try {
    thread_ = std::thread(
        [this, work = std::move(work), failed = std::move(failed)] { run(work, failed); });
  } catch (const std::system_error& error) {  // TasksMax of the unit
    return daemon::fail(ErrorCode::Io, fmt::format("{}: no thread can be started: {}", what_,
                                                   error.code().message()));
  }
  running_ = true;
  status_ = std::move(running);
  return {};
}

/// `outcome`: the status after an internal error.
void TaskThread::run(const Work& work, json outcome) {
  (void)::setpriority(PRIO_PROCESS, 0, kLowPriority);  // of this thread
  try {
    json ended = outcome;
    ended.erase("error");
    ended.update(work());
    outcome = std::move(ended);
  } catch (const std::exception& error) {
    report_internal_error(report_, error.what(), has_failed_.c_str());
  } catch (...) {
    report_internal_error(report_, "not a std::exception", has_failed_.c_str());
  }
  (void)::malloc_trim(0);  // the task may have used much memory
  const std::lock_guard lock(mutex_);
  running_ = false;
  status_ = std::move(outcome);
}

void TaskThread::update(const json& members) {
  const std::lock_guard lock(mutex_);
  if (running_) status_.update(members);
}

bool TaskThread::running() const {
  const std::lock_guard lock(mutex_);
  return running_;
}

json TaskThread::status() const {
  const std::lock_guard lock(mutex_);
  return status_;
}

}  // namespace abbe::web
