#pragma once
/// What the configured devices provide, whatever their kinds are: the other modules ask here, and
/// only the code of a kind looks at its own table. Pure.

#include <chrono>
#include <optional>
#include <string>
#include <string_view>

#include "abbe/config/reference_marks.hpp"
#include "abbe/config/usb_card.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::daemon {

struct Config;

/// The device that delivers tracker points.
struct TrackerSource {
  /// The air for which the controller corrects its distances.
  enum class Air {
    Measured,  ///< it measures the air
    Assumed,   ///< assumed_air()
    LastSet,   ///< the refractive index that was last set in it
  };

  std::string_view key;  ///< of its table
  double point_rate_hz = 0.0;
  /// Time of each mean value. nullopt: it delivers points during motion; else at standstills only.
  std::optional<std::chrono::nanoseconds> stationary_time = std::nullopt;
  double u_scale = 0.0;  ///< relative standard uncertainty common to all distances
  Air air = Air::Measured;
  std::string air_setting = {};  ///< that selects `air`, as in messages
};
[[nodiscard]] std::optional<TrackerSource> tracker_source(const Config& config);

/// The device that delivers touches.
struct TouchSource {
  std::string_view key;  ///< of its table
  std::string device;    ///< its name
  /// True: it reports the position of each touch. False: a touch has the readings of the axes.
  bool reports_positions = false;
  bool compensated = false;  ///< it corrects the positions that it reports
};
[[nodiscard]] std::optional<TouchSource> touch_source(const Config& config);

/// The card whose counters read the axes. Their zeros are unknown when it is set up; see Datum.
struct CountedAxes {
  std::string_view key;       ///< of its table
  const UsbCardConfig& card;  ///< in the Config
  /// An axis without marks is at its offset at the first set-up of the card.
  bool zero_is_here = false;

  [[nodiscard]] const auto& axes() const noexcept { return card.wiring.axes; }
};
[[nodiscard]] std::optional<CountedAxes> counted_axes(const Config& config);
/// In the Config; null: no card latches the counted axes at their marks.
[[nodiscard]] const ReferenceMarks* reference_marks(const Config& config);

/// Time between the axis samples, `periods` times. nullopt: no device has a fixed sample rate.
[[nodiscard]] std::optional<std::chrono::nanoseconds> time_of_axis_samples(const Config& config,
                                                                           double periods);

/// The quantities of all devices that measure the environment. The weather station of a tracker is
/// not one of them.
[[nodiscard]] protocol::EnvironmentMask measured_environment(const Config& config);

enum class Capability {
  TrackerPoints,
  Axes,         ///< reads the axes
  NamedAxes,    ///< reads the axes, and its table names them
  CountedAxes,  ///< counts increments of the axes
  Marks,        ///< latches the counts at reference marks
  Touches,      ///< delivers touches
  Errors,       ///< measures the errors of a machine: tracker points or touches
  Motion,       ///< moves and touches points under its own control
  Environment,  ///< measures air or temperatures
};
/// The tables, as in messages, of all kinds of devices with a capability, also if they are not
/// configured: "[a], [b] CONJUNCTION [c]".
[[nodiscard]] std::string tables_with(Capability capability, std::string_view conjunction = "or");

}  // namespace abbe::daemon
