#pragma once
/// The beginning of a further file of a recording. It allows the replay of this file to use the
/// readings of the environment sensors as the live run did: the state of the sensor checks, and the
/// samples after this state. The checks run in the order of the pipeline (SensorQueue), but later
/// by `watermark`. The reason: points of the new file may describe instants up to `watermark`
/// before its beginning, and need the samples of that time.

#include <chrono>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "abbe/messages/recording_info.hpp"
#include "abbe/pipeline/sensor_queue.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::daemon::recording {

class CarriedEnvironment {
 public:
  CarriedEnvironment(const SensorCheckOptions& options, std::string weather_station,
                     std::chrono::nanoseconds watermark)
      : queue_(options, watermark),
        checks_sensors_(!options.sensors.empty()),
        weather_station_(std::move(weather_station)),
        watermark_(watermark) {}

  void take(const protocol::EnvironmentSample& sample, std::string_view device,
            protocol::HostTime taken);
  /// Continues from the state with which the live run began.
  [[nodiscard]] Result<void> go_on(const RecordingAttachment& state) {
    return queue_.checks().go_on(state);
  }

  void accept(SensorAcceptance acceptance) { queue_.accept(std::move(acceptance)); }

  /// A new file begins after the cycle at time `at`.
  void begin_file(protocol::HostTime at) { check_until(state_until_ = at - watermark_); }
  /// Call it after begin_file(). True if the state contains the acceptance.
  [[nodiscard]] bool contains(const SensorAcceptance& acceptance) const noexcept {
    return acceptance.from < state_until_;
  }
  /// Call it after begin_file().
  [[nodiscard]] bool checks_sensors() const noexcept { return checks_sensors_; }
  [[nodiscard]] RecordingAttachment state() const { return queue_.checks().to_attachment(); }
  [[nodiscard]] protocol::HostTime state_at() const noexcept { return state_at_; }
  /// Calls use(device, sample): for each device first the last sample that the state contains, then
  /// the later samples.
  template <class Use>
  void for_each(Use use) const {
    for (const auto& [name, sample] : checked_) use(std::string_view{name}, sample);
    for (const auto& waiting : queue_.waiting())
      use(std::string_view{names_[waiting.device]}, waiting.sample);
  }

 private:
  void check_until(protocol::HostTime t);
  [[nodiscard]] std::size_t number_of(std::string_view device);

  SensorQueue queue_;
  bool checks_sensors_;
  std::string weather_station_;
  std::chrono::nanoseconds watermark_;
  std::vector<std::string> names_;  ///< names by SensorQueue::Waiting::device
  /// the last checked sample, by device
  std::map<std::string, protocol::EnvironmentSample> checked_;
  protocol::HostTime state_at_{};
  protocol::HostTime state_until_{};
};

}  // namespace abbe::daemon::recording
