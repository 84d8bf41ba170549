#pragma once
/// Upkeep of the recordings in the background. At the start it closes the recordings that a killed
/// abbed left open. Every hour it removes recordings that [recording] does not keep. One thread,
/// not the hub's.

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

/// A new name for a recording, "abbe-2026-11-21T03-40-12Z-4711": readable, sorted by time, unique
/// for each daemon process.
[[nodiscard]] std::string recording_name();

class RecordingUpkeep {
 public:
  using WallTime = std::chrono::steady_clock::time_point;
  static constexpr std::chrono::hours kPeriod{1};
  /// First removal after the start. It leaves a time server the time to correct the clock after
  /// boot.
  static constexpr std::chrono::minutes kFirst{10};

  /// `running`: name of the recording of this run. `config` must outlive this object.
  RecordingUpkeep(const Config& config, std::string running, WallClock clock);

  /// States that this run began at `now`, and begins to close the recordings that were left open.
  void start(WallTime now);
  /// Begins the work when it is due, and reports the results of the previous work on stderr. Never
  /// waits.
  void cycle(WallTime now);
  /// Ends the work of the start early. Does not wait for its end.
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
  bool removes_ = true;  // false once the clock was set
  std::future<Result<std::vector<std::filesystem::path>>> removing_;
  // These members belong to the background task; the end of abbed does not wait for it.
  const std::shared_ptr<std::atomic<bool>> stopping_ = std::make_shared<std::atomic<bool>>(false);
  std::future<Result<std::vector<LeftRecording>>> closing_;
};

}  // namespace abbe::daemon
