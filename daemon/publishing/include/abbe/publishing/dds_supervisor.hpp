#pragma once
/// Starts abbe-dds as a child process of abbed and restarts it when it ends:
/// - at once, if it ran for `steady_after` or longer;
/// - after `first_delay`, if a signal ended it earlier;
/// - after a delay that doubles from `first_delay` to `longest_delay`, if it exited earlier
///   (invalid profile, port in use).
///
/// A child that does not answer the hub is killed and therefore restarted. The child is identified
/// by its pid only and inherits no capabilities of abbed. Used by one thread, not a real-time one.
/// Only the destructor blocks.

#include <sys/types.h>

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "abbe/base/end_limits.hpp"
#include "abbe/base/error.hpp"
#include "abbe/messages/dds_process.hpp"

namespace abbe::daemon {

class DdsSupervisor {
 public:
  using WallTime = std::chrono::steady_clock::time_point;

  struct Options {
    std::filesystem::path program;       ///< path of abbe-dds
    std::vector<std::string> arguments;  ///< arguments without argv[0]
    int priority = 0;                    ///< SCHED_FIFO; 0, or not permitted: SCHED_OTHER
    /// If the child ran for this time, it is restarted without delay.
    std::chrono::milliseconds steady_after{2000};
    std::chrono::milliseconds first_delay{100};
    std::chrono::milliseconds longest_delay{5000};
    /// Destructor: time from SIGTERM to SIGKILL.
    std::chrono::milliseconds stop_patience = kLongestDdsEnd;
    /// State shared with the hub, which records the answers of the child in it; must outlive the
    /// supervisor. null: a hanging child is not detected.
    DdsProcess* process = nullptr;
    std::chrono::milliseconds hung_after{2000};       ///< longest time without an answer
    std::chrono::milliseconds hung_at_start{10'000};  ///< longest time before the first answer
  };

  /// Starts the child. Error (Io) if the program cannot be started at all (missing, not
  /// executable).
  [[nodiscard]] static Result<DdsSupervisor> start(Options options, WallTime now);
  ~DdsSupervisor();
  DdsSupervisor(DdsSupervisor&&) noexcept;
  DdsSupervisor& operator=(DdsSupervisor&&) noexcept;

  /// Detects that the child ended or hangs, and restarts it when the delay is over. Call every
  /// cycle, at least every 50 ms.
  void poll(WallTime now);

  [[nodiscard]] pid_t pid() const noexcept { return pid_; }  ///< 0: not running
  [[nodiscard]] std::uint64_t restarts() const noexcept { return restarts_; }
  /// The way in which the last child ended; nullopt: none has ended yet.
  [[nodiscard]] const std::optional<DdsEnd>& last_end() const noexcept { return last_end_; }
  /// The reason why the last attempt to start the child failed; further attempts follow. Empty: the
  /// last attempt succeeded.
  [[nodiscard]] const std::string& start_fault() const noexcept { return start_fault_; }

 private:
  explicit DdsSupervisor(Options options) : options_(std::move(options)) {}
  Result<void> spawn(WallTime now);
  void kill_if_hung() noexcept;
  [[nodiscard]] bool reap(WallTime now);  ///< true if the child has ended
  void stop() noexcept;

  Options options_;
  pid_t pid_ = 0;
  WallTime started_{};
  WallTime next_start_{};
  std::chrono::milliseconds delay_{0};
  std::uint64_t restarts_ = 0;
  bool hung_ = false;  // the supervisor killed the child because it did not answer
  std::optional<DdsEnd> last_end_;
  std::string start_fault_;
};

}  // namespace abbe::daemon
