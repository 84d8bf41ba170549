#include "abbe/methods/evemu/artefact_thermometer.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace abbe::daemon {

bool ArtefactThermometer::take(const protocol::Snapshot& touch) {
  if (!config_ || !config_->sensor) return true;
  if (!touch.has_environment) return false;
  const double t_K = touch.environment.temperature_K[*config_->sensor];
  if (!std::isfinite(t_K)) return false;
  lowest_K_ = count_ == 0 ? t_K : std::min(lowest_K_, t_K);
  highest_K_ = count_ == 0 ? t_K : std::max(highest_K_, t_K);
  sum_K_ += t_K;
  ++count_;
  return true;
}

std::optional<calib::evemu::ArtefactTemperature> ArtefactThermometer::over_the_run() const {
  if (!config_) return std::nullopt;
  if (!config_->sensor)
    return calib::evemu::ArtefactTemperature{config_->fixed_K, config_->u_temperature_K};
  if (count_ == 0) return std::nullopt;
  const double u_drift_K = (highest_K_ - lowest_K_) / (2.0 * std::numbers::sqrt3);
  return calib::evemu::ArtefactTemperature{sum_K_ / static_cast<double>(count_),
                                           std::hypot(u_drift_K, config_->u_temperature_K)};
}

}  // namespace abbe::daemon
