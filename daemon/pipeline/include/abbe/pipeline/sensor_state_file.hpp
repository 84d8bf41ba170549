#pragma once
/// State of the sensor checks that survives a restart of abbed: DATA_DIR/sensor-state.json. For the
/// checks a restart is only a gap in the readings: a sensor that was refused before stays refused,
/// and a sensor without a reading for forget_s loses its history, as it would without a restart.
/// Times are converted by the wall clock, so that the state also survives a restart of the
/// computer. The file may be a few seconds old. Not for the RT path.

#include <chrono>
#include <filesystem>
#include <string>
#include <string_view>

#include "abbe/pipeline/sensor_checks.hpp"

namespace abbe::daemon {

/// The same instant in host time and wall time. `speed`: host time per wall time.
struct SensorStateClock {
  protocol::HostTime host{};
  std::chrono::nanoseconds utc{};
  double speed = 1.0;
};

[[nodiscard]] std::filesystem::path sensor_state_file(const std::filesystem::path& data_dir);
/// Text of the file, with a checksum.
[[nodiscard]] std::string sensor_state_text(const SensorChecks& checks,
                                            const SensorStateClock& now);
/// The state in the text of the file, with its times converted to host times of this run.
/// Assumption: the wall clock was not set back since the file was written. Sensors that are not in
/// `options`, or that belong to another device now, are left out. BadInput for any text that
/// sensor_state_text() does not write.
[[nodiscard]] Result<RecordingAttachment> left_sensor_state(std::string_view text,
                                                            const SensorCheckOptions& options,
                                                            const SensorStateClock& now);

}  // namespace abbe::daemon
