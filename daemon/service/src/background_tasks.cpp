#include "abbe/service/background_tasks.hpp"

#include <pthread.h>
#include <sched.h>
#include <unistd.h>

#include <atomic>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

#include "abbe/base/wake_up.hpp"
#include "abbe/drivers/mailbox.hpp"

namespace abbe::daemon {
namespace {

std::atomic<int> running_work = 0;

}  // namespace

detail::RunningWork::RunningWork() noexcept {
  ++running_work;
}
detail::RunningWork::~RunningWork() {
  --running_work;
}

bool background_tasks_running() noexcept {
  return running_work > 0;
}

void become_ordinary_thread() noexcept {
  const sched_param none{};
  (void)::pthread_setschedparam(::pthread_self(), SCHED_OTHER, &none);
  cpu_set_t cpus;
  if (::sched_getaffinity(::getpid(), sizeof cpus, &cpus) == 0)  // the affinity of the main thread
    (void)::pthread_setaffinity_np(::pthread_self(), sizeof cpus, &cpus);
}

namespace {

using BackgroundTask = std::function<void()>;

/// The dispatcher and the worker threads. Only these ordinary threads take the mutex; a thread that
/// passes a task to the dispatcher does not.
class BackgroundThreads {
 public:
  BackgroundThreads() : dispatcher_([this] { dispatch(); }) {}
  BackgroundThreads(const BackgroundThreads&) = delete;
  BackgroundThreads& operator=(const BackgroundThreads&) = delete;
  ~BackgroundThreads() {
    if (::getpid() != process_) {  // a forked child does not have these threads
      dispatcher_.detach();
      return;
    }
    stopping_.store(true,
                    std::memory_order_release);  // release: pairs with the acquire in dispatch()
    come_.signal();
    dispatcher_.join();
  }

  /// Runs the task. May be called from any thread; takes no lock.
  void run(BackgroundTask work) {
    mail_.put(std::move(work));
    come_.signal();
  }

 private:
  void dispatch() {
    become_ordinary_thread();
    for (bool last = false; !last;) {
      come_.wait();
      last = stopping_.load(std::memory_order_acquire);
      for (auto& work : mail_.take()) give_to_a_thread(std::move(work));
    }
    {
      const std::lock_guard lock{mutex_};
      ending_ = true;
    }
    work_waits_.notify_all();
    for (auto& thread : threads_) thread.join();
  }

  void give_to_a_thread(BackgroundTask work) {
    std::unique_lock lock{mutex_};
    waiting_.push_back(std::move(work));
    if (idle_ >= waiting_.size()) {
      lock.unlock();
      work_waits_.notify_one();
      return;
    }

    lock.unlock();
    try {
      threads_.emplace_back([this] { serve(); });
    } catch (const std::system_error&) {  // no new thread possible: an existing one runs the task
      if (threads_.empty()) work_here();
    }
  }

  /// Runs the oldest waiting task on the dispatcher's thread. Later tasks are dispatched only after
  /// it.
  void work_here() {
    std::unique_lock lock{mutex_};
    BackgroundTask work = std::move(waiting_.front());
    waiting_.pop_front();
    lock.unlock();
    work();
  }

  void serve() {
    for (;;) {
      BackgroundTask work;
      {
        std::unique_lock lock{mutex_};
        ++idle_;
        work_waits_.wait(lock, [this] { return ending_ || !waiting_.empty(); });
        --idle_;
        if (waiting_.empty()) return;
        work = std::move(waiting_.front());
        waiting_.pop_front();
      }
      work();
    }
  }

  drivers::Mailbox<BackgroundTask> mail_;
  WakeUp come_;
  std::atomic<bool> stopping_{false};
  std::mutex mutex_;
  std::condition_variable work_waits_;
  std::deque<BackgroundTask> waiting_;  // guarded by mutex_
  std::size_t idle_ = 0;                // number of threads that wait; guarded by mutex_
  bool ending_ = false;                 // guarded by mutex_
  std::vector<std::thread> threads_;    // the threads of the dispatcher
  const pid_t process_ = ::getpid();
  std::thread dispatcher_;
};

BackgroundThreads& background_threads() {
  static BackgroundThreads threads;
  return threads;
}

}  // namespace

void prepare_background_tasks() {
  (void)background_threads();
}

void run_background_task(std::function<void()> work) {
  background_threads().run(std::move(work));
}

}  // namespace abbe::daemon
