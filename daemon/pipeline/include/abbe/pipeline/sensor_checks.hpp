#pragma once
/// Checks the readings of all environment sensors with the functions of calib/environment. For each
/// sensor it keeps the history, the value that is used, and the reason why a reading is not used.
/// The result depends on the samples and their times only: a replay that starts from the same state
/// gives the same values. Not for the RT path; not thread-safe.

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
  std::vector<std::string> axes;  ///< axes whose readings are corrected with this sensor
  calib::SensorDoubt doubt = calib::SensorDoubt::None;
  bool held = false;  ///< the last good value is used; false: there is no value
  /// Sentence with the sensor, its value, the expected value, and what the operator can do. It
  /// changes only when `doubt` or `held` changes.
  std::string text;
};

/// Number of times that the readings of a sensor began to be refused since the start.
struct SensorDoubts {
  std::string device;
  std::uint64_t count = 0;  ///< number of times a doubt about the sensor began
  protocol::HostTime latest{};
  std::string latest_text;
};

/// A sample after the check, with the values that are used.
struct CheckedEnvironment {
  protocol::EnvironmentSample sample;
  /// For each element of temperature_K: the applied value at the instant of the sample. From there
  /// the applied value follows temperature_K (calib::followed_value()).
  std::array<calib::FollowedValue, protocol::kMaxTemperatures> applied{};
};

class SensorChecks {
 public:
  explicit SensorChecks(SensorCheckOptions options);

  [[nodiscard]] bool empty() const noexcept { return sensors_.empty(); }

  /// Replaces the readings of `sample` in `mask` by the values that are used; NaN: there is none. A
  /// sample that is not later than the previous one of a sensor gets the present value of the
  /// sensor.
  [[nodiscard]] CheckedEnvironment checked(const protocol::EnvironmentSample& sample,
                                           protocol::EnvironmentMask mask);

  /// Reports a sample whose time is wrong: it was taken at `taken`, but is dated `ahead` later.
  /// `mask`: readings in the sample. The sample is not used, and counts as a doubt about its
  /// sensors.
  void note_future(protocol::EnvironmentMask mask, protocol::HostTime taken,
                   std::chrono::nanoseconds ahead);

  /// The quantities that the device `device` measures.
  [[nodiscard]] protocol::EnvironmentMask mask_of(std::string_view device) const;

  /// The sensors whose readings are not used now, in the order of the sensors in EnvironmentSample.
  [[nodiscard]] std::vector<SensorFinding> findings() const;
  /// The sensors whose readings were refused at least once since the start.
  [[nodiscard]] std::vector<SensorDoubts> doubts() const;
  /// The applied temperature of channel `channel` at `t`.
  [[nodiscard]] double applied(const CheckedEnvironment& checked, std::size_t channel,
                               protocol::HostTime t) const;

  /// Checks whether a person may accept `sensor` now. Error Usage: there is no such sensor. Error
  /// Refused: its readings are used already, or a fault must be repaired first; the text names the
  /// case.
  [[nodiscard]] Result<void> check_acceptance(std::string_view sensor) const;
  /// Discards the history of the sensor, which is then used when its next readings agree with each
  /// other, whatever the other sensors read. Also ends the doubt about its twin if the twin sends
  /// nothing.
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
    double usable = kNone;  ///< the last reading, if the checks of this sensor alone accept it
    double used = kNone;    ///< output
    // The following members are used only in the first sensor of a pair of twins.
    int twin_differs = 0;        ///< number of successive comparisons in which the twins differed
    bool twins_doubted = false;  ///< the last comparison confirmed that the twins differ
    std::chrono::nanoseconds at{};  ///< instant of the last sample
    bool judged = false;
    /// the first reading is not compared with other sensors, because a person accepted the sensor
    bool accepted = false;
    calib::SensorDoubt doubt = calib::SensorDoubt::None;
    /// values at the beginning of the doubt
    double reading = kNone, lowest = kNone, highest = kNone;
    std::uint64_t doubts = 0;
    std::chrono::nanoseconds latest{};  ///< instant at which the latest doubt began
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

/// Name of the attachment with the state of the checks, at the start of each further file of a
/// recording.
inline constexpr std::string_view kSensorStateName = "sensor-state.json";

}  // namespace abbe::daemon
