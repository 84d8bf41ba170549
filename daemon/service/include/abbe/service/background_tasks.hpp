#pragma once
/// Runs long tasks for threads that must not wait, such as the hub. A real-time thread must not
/// start a thread itself: starting one takes locks and memory, and the new thread inherits
/// scheduling policy and affinity, so that its work would run at the hub's real-time priority and
/// on the hub's processor. Instead the task is passed, without a lock, to a dispatcher thread,
/// which runs it on a worker thread. Dispatcher and workers are ordinary threads; idle workers are
/// reused.

#include <exception>
#include <functional>
#include <future>
#include <memory>
#include <optional>
#include <type_traits>
#include <utility>

namespace abbe::daemon {

/// Gives the calling thread the policy SCHED_OTHER and all processors of the main thread. (In abbed
/// these are all processors of the process: only device threads and the hub are pinned.) A setting
/// that the kernel refuses is left unchanged.
void become_ordinary_thread() noexcept;

/// Starts the dispatcher unless it is running already. Call this function before a thread that must
/// not wait passes its first task.
void prepare_background_tasks();

/// Runs `work`, which must not throw, on an ordinary thread. At a normal exit the program waits for
/// all such tasks.
void run_background_task(std::function<void()> work);

/// Runs `work` on an ordinary thread. `work` is destroyed on that thread before the future is
/// ready, so never on the thread that takes the result. An exception is stored in the future. The
/// destructor of the future does not wait: `work` must own all that it uses, or the caller must
/// wait for the future.
template <class Work>
[[nodiscard]] auto run_in_background(Work work) -> std::future<std::invoke_result_t<Work&>> {
  struct Job {
    std::optional<Work> work;
    std::promise<std::invoke_result_t<Work&>> promise = {};
  };

  auto job = std::make_shared<Job>(Job{.work = std::move(work)});
  auto result = job->promise.get_future();
  run_background_task([job = std::move(job)] {
    try {
      auto outcome = (*job->work)();
      job->work.reset();
      job->promise.set_value(std::move(outcome));
    } catch (...) {
      job->work.reset();
      job->promise.set_exception(std::current_exception());
    }
  });

  return result;
}

/// Destroys `object` on an ordinary thread, because freeing much memory takes too long for the
/// caller.
template <class T>
void destroy_in_background(T object) {
  run_background_task([held = std::make_shared<T>(std::move(object))] {});
}

namespace detail {
/// While an object of this class exists, background_tasks_running() returns true.
class RunningWork {
 public:
  RunningWork() noexcept;
  ~RunningWork();
  RunningWork(const RunningWork&) = delete;
  RunningWork& operator=(const RunningWork&) = delete;
};
}  // namespace detail

/// Same as run_in_background(), for work that may still run when the program exits. `work` must
/// refer only to objects that it owns.
template <class Work>
[[nodiscard]] auto run_abandonable(Work work) -> std::future<std::invoke_result_t<Work&>> {
  return run_in_background(
      [work = std::move(work), running = std::make_unique<detail::RunningWork>()]() mutable {
        return work();
      });
}

/// True if work started by run_abandonable() is still running. The process must then exit by
/// _exit(), because a normal exit would destroy static objects that this work uses.
[[nodiscard]] bool background_tasks_running() noexcept;

}  // namespace abbe::daemon
