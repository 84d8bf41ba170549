#pragma once
/// State of the checks of the sensors that survives a restart of abbed: DATA_DIR/sensor-state.json.
/// A restart is a gap in the readings and no more: a sensor that jumped before it stays refused,
/// and after forget_s without a reading a sensor has no history, as without a restart. Times are
/// carried over by the wall clock, so that a restart of the computer changes nothing either. The
/// file may be seconds old without harm. Not for the RT path.

#include <chrono>
#include <filesystem>
#include <string>
#include <string_view>

#include "abbe/pipeline/sensor_checks.hpp"

namespace abbe::daemon {

/// The same instant by both clocks. `speed`: host time per wall time.
struct SensorStateClock {
  protocol::HostTime host{};
  std::chrono::nanoseconds utc{};
  double speed = 1.0;
};

[[nodiscard]] std::filesystem::path sensor_state_file(const std::filesystem::path& data_dir);
/// Text of the file, with a checksum.
[[nodiscard]] std::string sensor_state_text(const SensorChecks& checks,
                                            const SensorStateClock& now);
/// The state in the text of the file, as if it had been made in this run; the wall clock was not
/// set back since. Sensors that are not in `options`, or now of another device, are left out.
/// BadInput for any text that sensor_state_text() does not write.
[[nodiscard]] Result<RecordingAttachment> left_sensor_state(std::string_view text,
                                                            const SensorCheckOptions& options,
                                                            const SensorStateClock& now);

}  // namespace abbe::daemon
