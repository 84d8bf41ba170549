#pragma once
/// Checks the readings of all environment sensors with the parts in calib/environment, and keeps
/// for each sensor its history, the value that is used, and why a reading is not. Depends on the
/// samples and their times only: a replay that starts from the same state gives the same values.
/// Not for the RT path; not thread-safe.

#include <array>
#include <chrono>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/calib/environment/followed_value.hpp"
#include "abbe/calib/environment/sensor_check.hpp"
#include "abbe/messages/recording_info.hpp"
#include "abbe/pipeline/sensor_options.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::daemon {

/// A sensor whose readings are not used now.
struct SensorFinding {
  std::string sensor, device;
  std::vector<std::string> axes;  ///< whose readings are corrected with it
  calib::SensorDoubt doubt = calib::SensorDoubt::None;
  bool held = false;  ///< the last good value is used; false: there is no value
  /// Which sensor, its value, what was expected and what to do. It changes only when `doubt` or
  /// `held` changes.
  std::string text;
};

/// How often readings of a sensor were not used since the start.
struct SensorDoubts {
  std::string device;
  std::uint64_t count = 0;  ///< times that a doubt began
  protocol::HostTime latest{};
  std::string latest_text;
};

/// A sample with the values that are used.
struct CheckedEnvironment {
  protocol::EnvironmentSample sample;
  /// of temperature_K: where the applied value was at the instant of the sample. It follows
  /// temperature_K from there (calib::followed_value()).
  std::array<calib::FollowedValue, protocol::kMaxTemperatures> applied{};
};

class SensorChecks {
 public:
  explicit SensorChecks(SensorCheckOptions options);

  [[nodiscard]] bool empty() const noexcept { return sensors_.empty(); }

  /// Replaces the readings of `sample` in `mask` by the values that are used; NaN: none. A sample
  /// that is not later than the previous one of a sensor gets the present value of the sensor.
  [[nodiscard]] CheckedEnvironment checked(const protocol::EnvironmentSample& sample,
                                           protocol::EnvironmentMask mask);

  /// A sample with the readings in `mask`, taken at `taken`, is dated `ahead` after that: it is not
  /// used, and counts as a doubt of its sensors.
  void note_future(protocol::EnvironmentMask mask, protocol::HostTime taken,
                   std::chrono::nanoseconds ahead);

  /// The quantities that the device `device` measures.
  [[nodiscard]] protocol::EnvironmentMask mask_of(std::string_view device) const;

  /// In the order of the sensors in EnvironmentSample.
  [[nodiscard]] std::vector<SensorFinding> findings() const;
  /// The sensors that were in doubt since the start, also for a single reading.
  [[nodiscard]] std::vector<SensorDoubts> doubts() const;
  /// The applied temperature of channel `channel` at `t`.
  [[nodiscard]] double applied(const CheckedEnvironment& checked, std::size_t channel,
                               protocol::HostTime t) const;

  /// Checks whether a person may accept `sensor` now. Error Usage: there is no such sensor. Error
  /// Refused: its readings are used already, or a fault must be repaired first; the text says
  /// which.
  [[nodiscard]] Result<void> check_acceptance(std::string_view sensor) const;
  /// Discards the history of the sensor: it is used when its next readings agree with each other,
  /// wherever the other sensors are. Also ends the doubt about it and a twin that is silent.
  void accept(std::string_view sensor);

  /// State at the start of a further file of a recording, or of a further run.
  [[nodiscard]] RecordingAttachment to_attachment() const;
  /// Continues from the state. Error BadInput if the attachment cannot be read.
  [[nodiscard]] Result<void> go_on(const RecordingAttachment& attachment);
  /// Adds `by` to all instants of the state.
  void shift(std::chrono::nanoseconds by);

 private:
  struct Sensor {
    CheckedSensor options;
    calib::SensorTrack track = {};
    calib::HeldValue held = {};
    calib::FollowedValue applied = {};
    double usable = kNone;  ///< the last reading, if nothing was wrong with it alone
    double used = kNone;    ///< output
    // Kept by the first sensor of a pair:
    int twin_differs = 0;           ///< comparisons in a row
    bool twins_doubted = false;     ///< since the last comparison
    std::chrono::nanoseconds at{};  ///< of the last sample
    bool judged = false;
    bool accepted = false;  ///< the first reading is not compared with other sensors
    calib::SensorDoubt doubt = calib::SensorDoubt::None;
    double reading = kNone, lowest = kNone, highest = kNone;  ///< when the doubt began
    std::uint64_t doubts = 0;
    std::chrono::nanoseconds latest{};  ///< when the latest doubt began
    std::string latest_text = {};
  };
  static constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

  [[nodiscard]] Sensor* at_place(std::size_t place);
  [[nodiscard]] const Sensor* named(std::string_view name) const;
  void judge_alone(Sensor& sensor, double reading);
  void judge_by_twin(Sensor& sensor);
  void compare_with_others(Sensor& sensor, double reading, calib::CheckedReading& verdict);
  void use(Sensor& sensor);
  [[nodiscard]] std::string text_of(const Sensor& sensor) const;
  static void note(Sensor& sensor, calib::SensorDoubt doubt, double reading, double lowest,
                   double highest);

  std::vector<Sensor> sensors_;
  double start_spread_K_;
};

/// Name of the attachment of the state, at the start of each further file of a recording.
inline constexpr std::string_view kSensorStateName = "sensor-state.json";

}  // namespace abbe::daemon
