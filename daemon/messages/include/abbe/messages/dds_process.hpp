#pragma once
/// What is known of the process abbe-dds, shared without a lock by the two threads that deal with
/// it: the supervisor's (main) writes how it started and ended, the hub's writes when it asked and
/// was answered. Everybody reads. Two members may belong to two moments: they are for a report and
/// for patience of seconds.

#include <sys/types.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

namespace abbe::daemon {

/// How abbe-dds ended.
struct DdsEnd {
  int wait_status = 0;  ///< of waitpid()
  bool hung = false;    ///< it was ended because it did not answer
  std::chrono::system_clock::time_point when{};

  [[nodiscard]] std::string text()
      const;  ///< "signal 11 (Segmentation fault) at 2026-11-22T16:58:22Z"
};

class DdsProcess {
 public:
  using WallTime = std::chrono::steady_clock::time_point;
  static constexpr std::chrono::milliseconds kPause{500};

  // The supervisor's thread.
  void started(pid_t pid, WallTime now) noexcept;
  void ended(const DdsEnd& end) noexcept;
  void restarted() noexcept { restarts_.fetch_add(1, std::memory_order_relaxed); }

  // The hub's thread.
  void asked(WallTime now) noexcept;                                  ///< a beat was due
  void answered(WallTime now) noexcept { store(answered_ns_, now); }  ///< abbe-dds has read one

  [[nodiscard]] pid_t pid() const noexcept {
    return pid_.load(std::memory_order_relaxed);
  }  ///< 0: none
  [[nodiscard]] std::uint64_t restarts() const noexcept {
    return restarts_.load(std::memory_order_relaxed);
  }
  [[nodiscard]] std::optional<DdsEnd> last_end() const noexcept;

  /// How long abbe-dds has left the hub without an answer. It counts from its start until it has
  /// answered once, and never while the hub itself does not ask: after a pause of kPause it begins
  /// anew.
  [[nodiscard]] std::chrono::nanoseconds silent_for() const noexcept;
  [[nodiscard]] bool has_answered() const noexcept;  ///< since it was started

 private:
  static void store(std::atomic<std::int64_t>& out, WallTime t) noexcept {
    out.store(t.time_since_epoch().count(), std::memory_order_relaxed);
  }

  // relaxed: each value stands for itself, nothing else is published with it
  std::atomic<pid_t> pid_{0};
  std::atomic<std::uint64_t> restarts_{0};
  std::atomic<std::int64_t> last_end_{
      0};  // seconds UTC << 24 | hung << 16 | wait status; 0: none yet
  std::atomic<std::int64_t> started_ns_{0};
  std::atomic<std::int64_t> asked_ns_{0};
  std::atomic<std::int64_t> asks_since_ns_{0};  // without a pause
  std::atomic<std::int64_t> answered_ns_{0};
};

}  // namespace abbe::daemon
