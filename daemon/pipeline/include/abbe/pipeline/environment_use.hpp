#pragma once
/// What the environment does to measurements: many devices' samples merged into what is in force at
/// an instant, scale readings corrected for the temperature of the scale, raw tracker distances for
/// the index of the air. Composition only: the formulas are calib's. Deterministic, so that a
/// replay is the live run again. Ordinary world; not thread-safe.

#include <array>
#include <chrono>
#include <cstddef>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "abbe/config/config.hpp"
#include "abbe/pipeline/batch.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::daemon {

/// A [[thermal]] with the place of its axis in AxisSample.
struct ThermalAxis {
  std::size_t axis = 0;
  ThermalConfig config;
};

struct EnvironmentUseOptions {
  /// by the devices of [[environment]]: not taken from the tracker then
  protocol::EnvironmentMask measured = 0;
  std::chrono::nanoseconds max_age{std::chrono::seconds{60}};
  std::vector<ThermalAxis> thermal;
  AirConfig air;
  double tracker_u_scale = 0.0;               ///< TrackerConfig::u_scale
  std::optional<std::string> unmeasured_air;  ///< unmeasured_air_text()
};

[[nodiscard]] EnvironmentUseOptions environment_use(const Config& config);

/// What the environment of an instant did to what was measured then.
struct EnvironmentEffect {
  std::array<double, 3> expansion_factor{1.0, 1.0,
                                         1.0};  ///< of the scales of X, Y, Z; 1 without [[thermal]]
  std::array<double, 3>
      u_expansion_factor{};  ///< relative standard uncertainty of it; 0 without [[thermal]]
  /// Relative standard uncertainty all distances have in common: of the index they were corrected
  /// with, and the tracker's own.
  double u_scale = 0.0;
};
/// None: what is configured was not available then.
[[nodiscard]] std::optional<EnvironmentEffect> effect_of(const protocol::Snapshot& snapshot,
                                                         const EnvironmentUseOptions& options);

/// Readings of X, Y, Z as true positions, as correct_for_temperature() makes them.
[[nodiscard]] std::array<double, 3> at_temperature(std::array<double, 3> reading_m,
                                                   const EnvironmentEffect& effect,
                                                   const EnvironmentUseOptions& options);

/// Mean over a run: temperatures of scales drift by less than what they are uncertain, or it is no
/// run.
class MeanEffect {
 public:
  void take(const EnvironmentEffect& effect);
  [[nodiscard]] EnvironmentEffect mean() const;

 private:
  EnvironmentEffect sum_{.expansion_factor = {0.0, 0.0, 0.0}};
  std::size_t count_ = 0;
};

/// Every quantity from the device that measures it: at most one of [[environment]], else the
/// tracker. A value of a device that has been silent for longer than max_age is NaN. Air that a
/// tracker assumes is not merged.
class EnvironmentMerge {
 public:
  /// A sample of [[environment]] is in force from `lag` after its instant: by then it has come,
  /// whatever the order of arrival, and an environment that is half a second old is as good.
  EnvironmentMerge(const EnvironmentUseOptions& options, std::chrono::nanoseconds lag);

  void take(const Batch& batch);
  /// What is in force at `t`; nothing yet: none.
  [[nodiscard]] std::optional<protocol::EnvironmentSample> at(protocol::HostTime t) const;
  /// Nobody will ask for an instant before this one.
  void forget(protocol::HostTime oldest);
  [[nodiscard]] protocol::HostTime newest() const noexcept { return newest_; }

 private:
  using Samples = std::deque<protocol::EnvironmentSample>;  // by time

  protocol::EnvironmentMask measured_;
  std::chrono::nanoseconds max_age_;
  std::chrono::nanoseconds lag_;
  Samples weather_;
  std::vector<Samples> devices_;
  protocol::HostTime newest_{};
};

/// Readings become true positions (and velocities), their uncertainty is added in quadrature. An
/// axis whose scale temperature is not known has no known position: it is set in missing_mask, and
/// AxisMissing is flagged.
void correct_for_temperature(protocol::Snapshot& snapshot, const EnvironmentUseOptions& options);

/// The index of the air of the sample, or why there is none (a quantity not available).
[[nodiscard]] Result<calib::RefractiveIndex> index_of_air(
    const protocol::EnvironmentSample& environment, const AirConfig& config);

/// With [air] assumed_index: the tracker point's distance is corrected; without a known index the
/// point is flagged PointInvalid. Else nothing.
void correct_for_air(protocol::Snapshot& snapshot, const EnvironmentUseOptions& options);

}  // namespace abbe::daemon
