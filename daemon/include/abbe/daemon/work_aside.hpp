#pragma once
/// Long work started from a thread that may not wait. A new thread inherits policy and affinity of the one
/// that starts it: work of the hub would run at the hub's real-time priority and on the hub's processor, and
/// the hub would get no turn until it ends. Here the new thread becomes an ordinary one first.

#include <future>
#include <type_traits>
#include <utility>

namespace abbe::daemon {

/// The calling thread from now on: SCHED_OTHER, and every processor the main thread may use (in abbed all
/// the process was given: only device threads and the hub are pinned). What the kernel refuses stays as it
/// is.
void become_ordinary_thread() noexcept;

/// `work` on an ordinary thread of its own. The future waits for it when it is destroyed.
template <class Work>
[[nodiscard]] auto start_aside(Work work) -> std::future<std::invoke_result_t<Work&>> {
  return std::async(std::launch::async, [work = std::move(work)]() mutable {
    become_ordinary_thread();
    return work();
  });
}

}  // namespace abbe::daemon
