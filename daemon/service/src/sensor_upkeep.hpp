#pragma once
/// Keeps the state of the sensor checks over a restart of abbed: reads DATA_DIR/sensor-state.json
/// at the start, and writes it every 5 s in the background. One thread, not the hub's.

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

  /// The state of the sensors in the earlier run; nullopt: the sensors start without a state. If
  /// the file cannot be used, adds a warning to `warnings`.
  [[nodiscard]] std::optional<RecordingAttachment> left(std::vector<std::string>& warnings) const;
  /// Writes the file when it is due. Does not wait for the disk; waits for the hub for at most 100
  /// ms.
  void cycle(WallTime now, Hub& hub);

 private:
  [[nodiscard]] SensorStateClock clock() const;
  void take_outcome();

  const Config& config_;
  const drivers::TimeSource& time_;
  std::future<Result<void>> writing_;
  std::string fault_;  ///< fault that was reported last
  WallTime next_ = WallTime::clock::now() + kWritten;
};

}  // namespace abbe::daemon
