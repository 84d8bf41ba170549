#pragma once
/// Upkeep of the recordings in the background: closes, at the start, those that a killed abbed left
/// open, and removes, every hour, those that [recording] does not keep. One thread, not the hub's.

#include <atomic>
#include <chrono>
#include <filesystem>
#include <future>
#include <memory>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/base/wall_clock.hpp"
#include "abbe/config/config.hpp"
#include "abbe/recording/left_recordings.hpp"

namespace abbe::daemon {

/// "abbe-2026-11-21T03-40-12Z-4711": readable, sorts by time, unique for each daemon process.
[[nodiscard]] std::string recording_name();

class RecordingUpkeep {
 public:
  using WallTime = std::chrono::steady_clock::time_point;
  static constexpr std::chrono::hours kPeriod{1};
  /// Time for a time server to correct the clock after boot.
  static constexpr std::chrono::minutes kFirst{10};

  /// `running`: name of the recording of this run. `config` must outlive this object.
  RecordingUpkeep(const Config& config, std::string running, WallClock clock);

  /// This run began at `now`: begins to close the recordings that were left open.
  void start(WallTime now);
  /// Begins the work when it is due, and reports what the last one did to stderr. Never waits.
  void cycle(WallTime now);
  /// Ends the work at the start early. Nothing waits for it.
  void stop() noexcept { *stopping_ = true; }

 private:
  void report_removed();
  void remove_old(WallTime now);
  void report_closed();

  const Config& config_;
  std::string running_;
  WallClock clock_;
  ClockSteps clock_steps_;
  WallTime running_since_{};
  WallTime next_ = WallTime::clock::now() + kFirst;
  bool removes_ = true;  // false after the clock was set
  std::future<Result<std::vector<std::filesystem::path>>> removing_;
  // Owned by the background task, which the end of abbed does not wait for.
  const std::shared_ptr<std::atomic<bool>> stopping_ = std::make_shared<std::atomic<bool>>(false);
  std::future<Result<std::vector<LeftRecording>>> closing_;
};

}  // namespace abbe::daemon
