#pragma once
/// State of the process abbe-dds, shared without a lock between two threads. The supervisor's
/// thread (main) writes when abbe-dds started and how it ended; the hub's thread writes the times
/// of beats and answers. Any thread may read. Values that are read together may come from different
/// times; they are used only for reports and for time limits of seconds.

#include <sys/types.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

namespace abbe::daemon {

/// The way in which abbe-dds ended.
struct DdsEnd {
  int wait_status = 0;  ///< status from waitpid()
  bool hung = false;    ///< abbed killed abbe-dds because it did not answer
  std::chrono::system_clock::time_point when{};

  /// "signal 11 (Segmentation fault) at 2026-11-22T16:58:22Z"
  [[nodiscard]] std::string text() const;
};

class DdsProcess {
 public:
  using WallTime = std::chrono::steady_clock::time_point;
  static constexpr std::chrono::milliseconds kPause{500};

  // Called by the supervisor's thread.
  void started(pid_t pid, WallTime now) noexcept;
  void ended(const DdsEnd& end) noexcept;
  void restarted() noexcept { restarts_.fetch_add(1, std::memory_order_relaxed); }

  // Called by the hub's thread.
  void asked(WallTime now) noexcept;  ///< a beat was due at this time
  void answered(WallTime now) noexcept { store(answered_ns_, now); }  ///< abbe-dds answered a beat

  /// 0: not running.
  [[nodiscard]] pid_t pid() const noexcept { return pid_.load(std::memory_order_relaxed); }
  [[nodiscard]] std::uint64_t restarts() const noexcept {
    return restarts_.load(std::memory_order_relaxed);
  }
  [[nodiscard]] std::optional<DdsEnd> last_end() const noexcept;

  /// Time from the last answer of abbe-dds to the last beat of the hub. Before the first answer the
  /// time starts at the start of abbe-dds. After a pause of more than kPause without a beat it
  /// starts at the first beat after the pause.
  [[nodiscard]] std::chrono::nanoseconds silent_for() const noexcept;
  /// true if abbe-dds has answered since its last start
  [[nodiscard]] bool has_answered() const noexcept;

 private:
  static void store(std::atomic<std::int64_t>& out, WallTime t) noexcept {
    out.store(t.time_since_epoch().count(), std::memory_order_relaxed);
  }

  // relaxed: each value is used alone, and no other data are published with it
  std::atomic<pid_t> pid_{0};
  std::atomic<std::uint64_t> restarts_{0};
  // seconds UTC << 24 | hung << 16 | wait status; 0: abbe-dds has not ended yet
  std::atomic<std::int64_t> last_end_{0};
  std::atomic<std::int64_t> started_ns_{0};
  std::atomic<std::int64_t> asked_ns_{0};
  std::atomic<std::int64_t> asks_since_ns_{0};  // first beat after the last pause
  std::atomic<std::int64_t> answered_ns_{0};
};

}  // namespace abbe::daemon
