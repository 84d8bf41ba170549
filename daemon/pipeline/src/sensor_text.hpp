#pragma once
/// Texts about a sensor whose readings are not used.

#include <chrono>
#include <string>

#include "abbe/calib/environment/sensor_check.hpp"
#include "abbe/pipeline/sensor_options.hpp"

namespace abbe::daemon {

/// A refused reading of a sensor. Values in SI; NaN: none.
struct DoubtedReading {
  calib::SensorDoubt doubt = calib::SensorDoubt::None;
  bool held = false;
  double reading = 0.0, lowest = 0.0, highest = 0.0;
  double used = 0.0;      ///< value that is used, if one is held
  std::string twin = {};  ///< name of the twin
};

/// The text about a sensor: "scale_x is not available (X is missing): it reads 85.00 C, expected
/// 20.80 to 21.80 C; check ..."
[[nodiscard]] std::string text_of(const CheckedSensor& sensor, const DoubtedReading& doubted);
/// The text about a sample with a future time: "scale_x: a reading dated 12.0 s in the future is
/// not used; ..."
[[nodiscard]] std::string future_text(const CheckedSensor& sensor, std::chrono::nanoseconds ahead);

}  // namespace abbe::daemon
