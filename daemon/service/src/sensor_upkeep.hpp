#pragma once
/// Keeps the state of the checks of the sensors over a restart of abbed: reads
/// DATA_DIR/sensor-state.json at the start, and writes it every 5 s in the background. One thread,
/// not the hub's.

#include <chrono>
#include <future>
#include <optional>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/pipeline/sensor_state_file.hpp"
#include "abbe/service/hub.hpp"

namespace abbe::daemon {

class SensorUpkeep {
 public:
  using WallTime = std::chrono::steady_clock::time_point;
  static constexpr std::chrono::seconds kWritten{5};

  /// Both arguments must outlive this object.
  SensorUpkeep(const Config& config, const drivers::TimeSource& time)
      : config_(config), time_(time) {}

  /// The state of the sensors in the earlier run; nullopt: they start without one. A file that
  /// cannot be used is added to `warnings`.
  [[nodiscard]] std::optional<RecordingAttachment> left(std::vector<std::string>& warnings) const;
  /// Writes the file when it is due. Does not wait for the disk, and 100 ms at most for the hub.
  void cycle(WallTime now, Hub& hub);

 private:
  [[nodiscard]] SensorStateClock clock() const;
  void take_outcome();

  const Config& config_;
  const drivers::TimeSource& time_;
  std::future<Result<void>> writing_;
  std::string fault_;  ///< as reported
  WallTime next_ = WallTime::clock::now() + kWritten;
};

}  // namespace abbe::daemon
