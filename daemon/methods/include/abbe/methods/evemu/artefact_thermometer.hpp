#pragma once
/// How warm the ball array was over a run, by a temperature of [[environment]] or by what the
/// configuration says. From snapshots alone: a replay finds the same bits. Ordinary world; not
/// thread-safe.

#include <cstddef>
#include <optional>

#include "abbe/calib/evemu/artefact.hpp"
#include "abbe/config/config.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::daemon {

class ArtefactThermometer {
 public:
  explicit ArtefactThermometer(std::optional<ArtefactTemperatureConfig> config) : config_(config) {}

  /// False: the sensor has no valid value at this touch.
  [[nodiscard]] bool take(const protocol::Snapshot& touch);

  /// Mean of the sensor's values. u: half their range as a rectangular distribution, (max -
  /// min) / (2 sqrt
  /// 3) ([GUM] 4.3.7), and the configured one. None: nobody knows.
  [[nodiscard]] std::optional<calib::evemu::ArtefactTemperature> over_the_run() const;

 private:
  std::optional<ArtefactTemperatureConfig> config_;
  double sum_K_ = 0.0, lowest_K_ = 0.0, highest_K_ = 0.0;
  std::size_t count_ = 0;
};

}  // namespace abbe::daemon
