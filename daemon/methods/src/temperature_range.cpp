#include "abbe/methods/temperature_range.hpp"

#include <algorithm>

namespace abbe::daemon {

void TemperatureRange::add(double temperature_K) {
  if (!(temperature_K > 0.0)) return;  // not measured: the value is 0 or NaN
  if (!range_K_) range_K_ = {temperature_K, temperature_K};
  (*range_K_)[0] = std::min((*range_K_)[0], temperature_K);
  (*range_K_)[1] = std::max((*range_K_)[1], temperature_K);
}

void TemperatureRange::take(const protocol::Snapshot& snapshot) {
  if (!snapshot.has_environment) return;
  add(snapshot.environment.air_temperature_K);
  for (const double temperature_K : snapshot.environment.temperature_K) add(temperature_K);
}

}  // namespace abbe::daemon
