#pragma once
/// Starts abbe-dds as a child of abbed and starts it again when it ends: at once if it had been up
/// for a while, after `first_delay` if a signal ends it at start, with a growing delay if it exits
/// at start (bad profile, port in use). A child that does not answer the hub is killed and so
/// started again. Knows its child by pid only; the child inherits none of abbed's capabilities.
/// Used by one thread that is not real-time; never blocks but in the destructor.

#include <sys/types.h>

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/messages/dds_process.hpp"

namespace abbe::daemon {

class DdsSupervisor {
 public:
  using WallTime = std::chrono::steady_clock::time_point;

  struct Options {
    std::filesystem::path program;       ///< abbe-dds
    std::vector<std::string> arguments;  ///< without argv[0]
    int priority = 0;                    ///< SCHED_FIFO; 0, or not permitted: an ordinary process
    std::chrono::milliseconds steady_after{
        2000};  ///< alive this long: the next death is answered at once
    std::chrono::milliseconds first_delay{100};  ///< after a death at start; doubles
    std::chrono::milliseconds longest_delay{5000};
    std::chrono::milliseconds stop_patience{
        3000};  ///< destructor: SIGTERM, then this long, then SIGKILL
    /// Outlives the supervisor; null: nobody asks the child whether it hangs.
    DdsProcess* process = nullptr;
    std::chrono::milliseconds hung_after{2000};       ///< no answer for this long
    std::chrono::milliseconds hung_at_start{10'000};  ///< not one answer since its start
  };

  /// Error (Io) if the program cannot be started at all (missing, not executable).
  [[nodiscard]] static Result<DdsSupervisor> start(Options options, WallTime now);
  ~DdsSupervisor();
  DdsSupervisor(DdsSupervisor&&) noexcept;
  DdsSupervisor& operator=(DdsSupervisor&&) noexcept;

  /// Notices an end or a hang and starts again when it is time. Call every cycle, at least every
  /// 50 ms.
  void poll(WallTime now);

  [[nodiscard]] pid_t pid() const noexcept { return pid_; }  ///< 0 while there is none
  [[nodiscard]] std::uint64_t restarts() const noexcept { return restarts_; }
  /// How the last child ended; none: none has.
  [[nodiscard]] const std::optional<DdsEnd>& last_end() const noexcept { return last_end_; }
  /// Why the next child cannot be started, which is tried again; empty: it can.
  [[nodiscard]] const std::string& start_fault() const noexcept { return start_fault_; }

 private:
  explicit DdsSupervisor(Options options) : options_(std::move(options)) {}
  Result<void> spawn(WallTime now);
  void kill_if_hung() noexcept;
  [[nodiscard]] bool reap(WallTime now);  ///< whether there is no child any more
  void stop() noexcept;

  Options options_;
  pid_t pid_ = 0;
  WallTime started_{};
  WallTime next_start_{};
  std::chrono::milliseconds delay_{0};
  std::uint64_t restarts_ = 0;
  bool hung_ = false;  // the child was killed because it did not answer
  std::optional<DdsEnd> last_end_;
  std::string start_fault_;
};

}  // namespace abbe::daemon
