#pragma once
/// Long work started from a thread that may not wait. To start a thread takes locks and memory, and
/// the new one inherits policy and affinity: work of the hub would run at the hub's real-time
/// priority and on the hub's processor. So the work is handed over without a lock to a dispatcher,
/// an ordinary thread, which runs it on another ordinary thread. A thread that has nothing to do is
/// used again.

#include <exception>
#include <functional>
#include <future>
#include <memory>
#include <optional>
#include <type_traits>
#include <utility>

namespace abbe::daemon {

/// The calling thread from now on: SCHED_OTHER, and every processor the main thread may use (in
/// abbed all the process was given: only device threads and the hub are pinned). What the kernel
/// refuses stays as it is.
void become_ordinary_thread() noexcept;

/// Starts the dispatcher if it does not run yet. To be called before a thread that may not wait
/// starts work.
void prepare_background_tasks();

/// Runs `work`, which must not throw, on an ordinary thread. All of it is done before the program
/// ends.
void run_background_task(std::function<void()> work);

/// `work` on an ordinary thread, where it is destroyed before the future is ready: never by who
/// takes the outcome. An exception goes into the future, which does not wait when it is destroyed:
/// `work` owns what it uses, or its owner waits.
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

/// Destroys `object` on an ordinary thread: to give back much memory takes long.
template <class T>
void destroy_in_background(T object) {
  run_background_task([held = std::make_shared<T>(std::move(object))] {});
}

namespace detail {
/// Counts while it lives.
class RunningWork {
 public:
  RunningWork() noexcept;
  ~RunningWork();
  RunningWork(const RunningWork&) = delete;
  RunningWork& operator=(const RunningWork&) = delete;
};
}  // namespace detail

/// run_in_background() of work that may not end in time, and refers to nothing but what it owns.
template <class Work>
[[nodiscard]] auto run_abandonable(Work work) -> std::future<std::invoke_result_t<Work&>> {
  return run_in_background(
      [work = std::move(work), running = std::make_unique<detail::RunningWork>()]() mutable {
        return work();
      });
}

/// Whether such work still runs. A process that ends with it ends by _exit(): what it uses must not
/// be destroyed under it.
[[nodiscard]] bool background_tasks_running() noexcept;

}  // namespace abbe::daemon
