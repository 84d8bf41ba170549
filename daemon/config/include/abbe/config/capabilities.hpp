#pragma once
/// The functions of the configured devices (reads axes, delivers touches, moves ...), independent
/// of the kind of device (tracker, encoder, ...). Other modules use this header; only the source
/// files of a kind read the configuration table of that kind. Pure.

#include <chrono>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/config/motion_box.hpp"
#include "abbe/config/reference_marks.hpp"
#include "abbe/config/usb_card.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::daemon {

struct Config;

/// The device that delivers tracker points.
struct TrackerSource {
  /// The air whose refractive index the tracker's controller uses to correct its distances.
  enum class Air {
    Measured,  ///< the controller measures the air
    Assumed,   ///< assumed_air()
    /// corrected with the refractive index that was last set in the controller
    LastSet,
  };

  std::string_view key;  ///< key of the device's configuration table
  std::string device;    ///< name of the device
  double point_rate_hz = 0.0;
  /// Duration of a measurement of a stationary reflector; the device then delivers one mean value
  /// for each. nullopt: the device delivers points during motion.
  std::optional<std::chrono::nanoseconds> stationary_time = std::nullopt;
  double u_scale = 0.0;  ///< relative standard uncertainty common to all distances of the tracker
  Air air = Air::Measured;
  /// the configuration key that selects `air`, as text for messages
  std::string air_setting = {};
};
[[nodiscard]] std::optional<TrackerSource> tracker_source(const Config& config);

/// The device that delivers touches.
struct TouchSource {
  std::string_view key;  ///< key of the device's configuration table
  std::string device;    ///< name of the device
  /// True: the device reports the position of each touch. False: a touch contains the readings of
  /// the axes.
  bool reports_positions = false;
  bool compensated = false;  ///< the device corrects the positions that it reports
};
[[nodiscard]] std::optional<TouchSource> touch_source(const Config& config);

/// The device that moves and touches points under its own control.
struct MotionSource {
  std::string_view key;             ///< key of the device's configuration table
  std::string device;               ///< name of the device
  std::optional<MotionBox> volume;  ///< volume in which it may move; nullopt: its table sets none
};
[[nodiscard]] std::optional<MotionSource> motion_source(const Config& config);

/// The card whose counters read the axes. When the card is set up its counters start at 0, so the
/// axis readings have an unknown offset until the axes are referenced; see AxisZeros.
struct CountedAxes {
  std::string_view key;       ///< key of the card's configuration table
  const UsbCardConfig& card;  ///< refers into the Config
  /// True: an axis without reference marks has its configured offset as reading when the card is
  /// set up for the first time. False: such an axis is not referenced then.
  bool zero_is_here = false;

  [[nodiscard]] const auto& axes() const noexcept { return card.wiring.axes; }
};
[[nodiscard]] std::optional<CountedAxes> counted_axes(const Config& config);
/// The reference marks in `config` (no copy); null if no card latches the counted axes at their
/// marks.
[[nodiscard]] const ReferenceMarks* reference_marks(const Config& config);

/// `periods` times the time between two axis samples. nullopt: no device has a fixed sample rate.
[[nodiscard]] std::optional<std::chrono::nanoseconds> time_of_axis_samples(const Config& config,
                                                                           double periods);

/// A device that measures quantities of the environment in rounds.
struct EnvironmentSource {
  std::string device;  ///< name of the device
  protocol::EnvironmentMask measured = 0;
  std::chrono::nanoseconds period{};  ///< time between two rounds
};
[[nodiscard]] std::vector<EnvironmentSource> environment_sources(const Config& config);

/// The quantities of all devices that measure the environment. The weather station of a tracker is
/// not one of them.
[[nodiscard]] protocol::EnvironmentMask measured_environment(const Config& config);

enum class Capability {
  TrackerPoints,
  Axes,         ///< reads the axes
  NamedAxes,    ///< reads the axes, and its configuration table names them
  CountedAxes,  ///< counts increments of the axes
  Marks,        ///< latches the counts at reference marks
  Touches,      ///< delivers touches
  Errors,       ///< measures the errors of a machine: tracker points or touches
  Motion,       ///< moves and touches points under its own control
  Environment,  ///< measures air or temperatures
};
/// The tables of all kinds of devices that have the capability, whether configured or not, as text
/// for messages: "[a], [b] CONJUNCTION [c]".
[[nodiscard]] std::string tables_with(Capability capability, std::string_view conjunction = "or");

}  // namespace abbe::daemon
