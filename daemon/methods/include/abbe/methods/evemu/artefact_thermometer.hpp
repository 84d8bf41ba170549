#pragma once
/// Mean temperature of the ball array over a run, from a sensor of an environment device or from a
/// fixed value in the configuration. Depends on snapshots only, so that a replay gives
/// bit-identical results. Not for the RT path; not thread-safe.

#include <cstddef>
#include <optional>

#include "abbe/calib/evemu/run/artefact.hpp"
#include "abbe/config/config.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::daemon {

class ArtefactThermometer {
 public:
  explicit ArtefactThermometer(std::optional<ArtefactTemperatureConfig> config) : config_(config) {}

  /// Adds the temperature at a touch. False if the sensor has no valid value at this instant.
  [[nodiscard]] bool take(const protocol::Snapshot& touch);

  /// Mean of the sensor's values. Its standard uncertainty is the root sum of squares of the
  /// configured standard uncertainty and of
  ///     (max - min) / (2 sqrt(3)),
  /// a rectangular distribution over the range of the values ([GUM] 4.3.7). nullopt: the
  /// temperature is not known.
  [[nodiscard]] std::optional<calib::evemu::ArtefactTemperature> over_the_run() const;

 private:
  std::optional<ArtefactTemperatureConfig> config_;
  double sum_K_ = 0.0, lowest_K_ = 0.0, highest_K_ = 0.0;
  std::size_t count_ = 0;
};

}  // namespace abbe::daemon
