#pragma once
/// Environmental corrections of measurements. Merges the samples of all environment devices into
/// the values that apply at an instant, corrects scale readings for the temperature of the scale,
/// and raw tracker distances for the refractive index of the air. The formulas are in calib.
/// Deterministic, so that a replay gives the results of the live run. Not for the RT path; not
/// thread-safe.

#include <array>
#include <chrono>
#include <cstddef>
#include <deque>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "abbe/calib/environment/refractive_index.hpp"
#include "abbe/config/config.hpp"
#include "abbe/pipeline/batch.hpp"
#include "abbe/pipeline/sensor_checks.hpp"
#include "abbe/pipeline/sensor_queue.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::daemon {

/// One [[thermal]] table, with the index of its axis in AxisSample.
struct ThermalAxis {
  std::size_t axis = 0;
  ThermalConfig config;
};

struct EnvironmentUseOptions {
  /// quantities that environment devices measure; for these the tracker's values are not used
  protocol::EnvironmentMask measured = 0;
  std::chrono::nanoseconds max_age{std::chrono::seconds{60}};
  std::vector<ThermalAxis> thermal;
  AirConfig air;
  double tracker_u_scale = 0.0;               ///< TrackerSource::u_scale
  std::optional<std::string> unmeasured_air;  ///< unmeasured_air_text()
  /// options of the sensor checks; empty: readings are used without a check
  SensorCheckOptions sensors;
};

[[nodiscard]] EnvironmentUseOptions environment_use(const Config& config);

/// Effect of the environment on the measurements of one instant.
struct EnvironmentEffect {
  /// expansion factor of the scales of X, Y, Z; 1 without [[thermal]]
  std::array<double, 3> expansion_factor{1.0, 1.0, 1.0};
  /// relative standard uncertainty of expansion_factor; 0 without [[thermal]]
  std::array<double, 3> u_expansion_factor{};
  /// Relative standard uncertainty common to all distances of the tracker, from two parts: the
  /// refractive index used for the correction, and TrackerSource::u_scale.
  double u_scale = 0.0;
};
/// The effect at the instant of the snapshot. nullopt: a configured quantity was not available
/// then.
[[nodiscard]] std::optional<EnvironmentEffect> effect_of(const protocol::Snapshot& snapshot,
                                                         const EnvironmentUseOptions& options);

/// Readings of X, Y, Z corrected to true positions, with the formula of correct_for_temperature().
[[nodiscard]] std::array<double, 3> at_temperature(std::array<double, 3> reading_m,
                                                   const EnvironmentEffect& effect,
                                                   const EnvironmentUseOptions& options);

/// Mean over a run of the effect of the environment. Assumption: the temperatures of the scales
/// drift by less than their uncertainty during a run.
class MeanEffect {
 public:
  void take(const EnvironmentEffect& effect);
  [[nodiscard]] EnvironmentEffect mean() const;

 private:
  EnvironmentEffect sum_{.expansion_factor = {0.0, 0.0, 0.0}};
  std::size_t count_ = 0;
};

/// Merges the environment samples of all devices. Every quantity is taken from the environment
/// device that measures it (there is at most one), else from the tracker. If a device has sent
/// nothing for longer than max_age, its values are NaN. Air values that a tracker assumes without
/// measuring are not merged.
/// Every reading is checked (SensorChecks), in the order of SensorQueue. For the temperature of a
/// scale the result is the applied temperature, which follows the readings at a limited rate.
class EnvironmentMerge {
 public:
  /// A sample of an environment device is used only for instants at least `lag` later than its own.
  /// `lag` is the assembler's watermark: after this time the sample has arrived, so that the order
  /// of arrival does not matter. The environment changes so slowly that the delay is negligible.
  EnvironmentMerge(const EnvironmentUseOptions& options, std::chrono::nanoseconds lag);

  void take(const Batch& batch);
  /// The merged values that apply at `t`; nullopt before the first sample.
  [[nodiscard]] std::optional<protocol::EnvironmentSample> at(protocol::HostTime t);
  /// Removes the samples that at() would need only for instants before `oldest`.
  void forget(protocol::HostTime oldest);
  [[nodiscard]] protocol::HostTime newest() const noexcept { return newest_; }

  /// The sensors whose readings are not used, according to the samples checked so far.
  [[nodiscard]] std::vector<SensorFinding> findings() const { return queue_.checks().findings(); }
  [[nodiscard]] const SensorChecks& sensors() const noexcept { return queue_.checks(); }
  void accept(SensorAcceptance acceptance) { queue_.accept(std::move(acceptance)); }
  [[nodiscard]] std::vector<SensorDoubts> doubts() const { return queue_.checks().doubts(); }
  /// Continues from the state of the sensors at the start of a further file, or from that of an
  /// earlier run.
  [[nodiscard]] Result<void> go_on(const RecordingAttachment& sensor_state) {
    return queue_.checks().go_on(sensor_state);
  }

 private:
  using Samples = std::deque<CheckedEnvironment>;  // in order of time

  void check_until(protocol::HostTime t);
  void merge_device(const CheckedEnvironment& from, protocol::HostTime t,
                    protocol::EnvironmentSample& to) const;

  protocol::EnvironmentMask measured_;
  std::chrono::nanoseconds max_age_;
  std::chrono::nanoseconds lag_;
  SensorQueue queue_;
  Samples weather_;
  std::vector<Samples> devices_;
  protocol::HostTime newest_{};
};

/// Corrects readings to true positions and velocities, and adds the uncertainty of the correction
/// in quadrature. An axis whose scale temperature is not known is set in missing_mask, and
/// AxisMissing is flagged.
void correct_for_temperature(protocol::Snapshot& snapshot, const EnvironmentUseOptions& options);

/// Refractive index of the air of the sample. DataInsufficient if a quantity is not available.
[[nodiscard]] Result<calib::RefractiveIndex> index_of_air(
    const protocol::EnvironmentSample& environment, const AirConfig& config);

/// With [air] assumed_index: corrects the distance of the tracker point; if the refractive index is
/// not known, the point is flagged PointInvalid. Without assumed_index the snapshot is not changed.
void correct_for_air(protocol::Snapshot& snapshot, const EnvironmentUseOptions& options);

}  // namespace abbe::daemon
