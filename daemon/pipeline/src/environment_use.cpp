#include "abbe/pipeline/environment_use.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <utility>

#include "abbe/calib/environment/thermal_expansion.hpp"
#include "abbe/calib/statistics/root_sum_of_squares.hpp"
#include "abbe/config/calibration_input.hpp"
#include "abbe/config/capabilities.hpp"
#include "abbe/config/unmeasured_air.hpp"

namespace abbe::daemon {
namespace {

using protocol::EnvironmentMask;
using protocol::EnvironmentSample;
using protocol::HostTime;
using protocol::SampleFlag;
using std::chrono::nanoseconds;

constexpr double kNotAvailable = std::numeric_limits<double>::quiet_NaN();

void copy_if(EnvironmentMask mask, EnvironmentMask bit, double from, double& to) {
  if ((mask & bit) != 0) to = from;
}

/// Copies the quantities in `mask` from `from` to `to`; they become NaN if `from` is too old.
void merge(const EnvironmentSample& from, EnvironmentMask mask, bool too_old,
           EnvironmentSample& to) {
  const auto value = [too_old](double v) { return too_old ? kNotAvailable : v; };
  copy_if(mask, protocol::kAirTemperature, value(from.air_temperature_K), to.air_temperature_K);
  copy_if(mask, protocol::kAirPressure, value(from.air_pressure_Pa), to.air_pressure_Pa);
  copy_if(mask, protocol::kRelativeHumidity, value(from.relative_humidity), to.relative_humidity);
  for (std::size_t i = 0; i < protocol::kMaxTemperatures; ++i)
    copy_if(mask, protocol::temperature_bit(i), value(from.temperature_K[i]), to.temperature_K[i]);
  to.measured = static_cast<EnvironmentMask>(to.measured | mask);
  if (from.head.time > to.head.time) to.head = from.head;
}

/// Inserts the sample by its time: after a restart of a device's clock, it may be earlier than the
/// sample that arrived before it.
void insert_by_time(std::deque<CheckedEnvironment>& in_order, const CheckedEnvironment& checked) {
  const auto later = [](HostTime t, const CheckedEnvironment& other) {
    return t < other.sample.head.time;
  };
  in_order.insert(
      std::upper_bound(in_order.begin(), in_order.end(), checked.sample.head.time, later), checked);
}

/// The latest sample whose time is not after `t`; null if there is none.
const CheckedEnvironment* latest_at(const std::deque<CheckedEnvironment>& samples, HostTime t) {
  const auto later = [](HostTime at, const CheckedEnvironment& checked) {
    return at < checked.sample.head.time;
  };
  const auto after = std::upper_bound(samples.begin(), samples.end(), t, later);
  return after == samples.begin() ? nullptr : &*std::prev(after);
}

void forget_before(std::deque<CheckedEnvironment>& samples, HostTime t) {
  while (samples.size() > 1 && samples[1].sample.head.time <= t) samples.pop_front();
}

}  // namespace

EnvironmentUseOptions environment_use(const Config& config) {
  EnvironmentUseOptions use;
  use.max_age = config.air.max_age;
  use.measured = measured_environment(config);
  use.air = config.air;
  use.sensors = sensor_check_options(config);
  if (const auto tracker = tracker_source(config)) {
    use.tracker_u_scale = tracker->u_scale;
    use.unmeasured_air = unmeasured_air_text(config, tracker->u_scale);
  }

  const auto axes = config.connected_axes();
  for (const ThermalConfig& thermal : config.thermal) {
    const auto axis = std::find(axes.begin(), axes.end(), thermal.axis);
    if (axis != axes.end())
      use.thermal.push_back({static_cast<std::size_t>(axis - axes.begin()), thermal});
  }

  return use;
}

EnvironmentMerge::EnvironmentMerge(const EnvironmentUseOptions& options, nanoseconds lag)
    : measured_(options.measured),
      max_age_(options.max_age),
      lag_(lag),
      queue_(options.sensors, lag) {}

void EnvironmentMerge::take(const Batch& batch) {
  const auto advance_to = [&](HostTime t) {
    if (batch.taken == HostTime{} || t - batch.taken <= kMostAhead) newest_ = std::max(newest_, t);
  };
  for (const auto& sample : batch.environment) {
    queue_.add_weather(0, sample, static_cast<EnvironmentMask>(sample.measured & ~measured_),
                       batch.taken);
    advance_to(sample.head.time);
  }
  for (const auto& [device, sample] : batch.measured_environment) {
    queue_.add(device, sample, sample.measured, batch.taken);
    advance_to(sample.head.time);
  }
  for (const auto& sample : batch.axes) advance_to(sample.head.time);
  check_until(batch.taken != HostTime{} ? batch.taken : newest_);
}

void EnvironmentMerge::check_until(HostTime t) {
  queue_.check_until(t, [&](const SensorQueue::Waiting& read, const CheckedEnvironment& checked) {
    if (read.weather) return insert_by_time(weather_, checked);
    if (read.device >= devices_.size()) devices_.resize(read.device + 1);
    insert_by_time(devices_[read.device], checked);
  });
}

void EnvironmentMerge::merge_device(const CheckedEnvironment& from, HostTime t,
                                    EnvironmentSample& to) const {
  EnvironmentSample applied = from.sample;
  for (std::size_t i = 0; i < protocol::kMaxTemperatures; ++i)
    applied.temperature_K[i] = queue_.checks().applied(from, i, t);
  merge(applied, applied.measured, t - applied.head.time > max_age_, to);
}

std::optional<EnvironmentSample> EnvironmentMerge::at(HostTime t) {
  check_until(t);
  EnvironmentSample merged;
  merged.measured = 0;
  merged.air_temperature_K = merged.air_pressure_Pa = merged.relative_humidity = kNotAvailable;
  bool any = false;

  if (const auto* weather = latest_at(weather_, t);
      weather != nullptr && weather->sample.measured != 0) {
    // The tracker's controller sends its weather with its points only, so its age is not checked.
    merge(weather->sample, static_cast<EnvironmentMask>(weather->sample.measured & ~measured_),
          false, merged);
    any = true;
  }

  for (const auto& samples : devices_) {
    const auto* from = latest_at(samples, t - lag_);
    if (from == nullptr) continue;
    merge_device(*from, t - lag_, merged);
    any = true;
  }

  if (!any) return std::nullopt;
  return merged;
}

void EnvironmentMerge::forget(HostTime oldest) {
  forget_before(weather_, oldest);
  for (auto& samples : devices_) forget_before(samples, oldest - lag_);
}

namespace {

calib::Expansion expansion(const ThermalConfig& config, double temperature_K) {
  return {config.alpha_per_K, config.u_alpha_per_K, temperature_K, config.u_temperature_K};
}

}  // namespace

std::optional<EnvironmentEffect> effect_of(const protocol::Snapshot& s,
                                           const EnvironmentUseOptions& options) {
  EnvironmentEffect effect;
  effect.u_scale = options.tracker_u_scale;
  for (const ThermalAxis& thermal : options.thermal) {
    if (thermal.axis >= effect.expansion_factor.size()) continue;
    const double t_K =
        s.has_environment ? s.environment.temperature_K[thermal.config.temperature] : kNotAvailable;
    if (std::isnan(t_K)) return std::nullopt;
    effect.expansion_factor[thermal.axis] = calib::expansion_factor(expansion(thermal.config, t_K));
    effect.u_expansion_factor[thermal.axis] =
        calib::u_expansion_factor(expansion(thermal.config, t_K));
  }

  if (options.air.assumed_index) {
    const auto index = s.has_environment ? index_of_air(s.environment, options.air)
                                         : Result<calib::RefractiveIndex>{};
    if (!s.has_environment || !index) return std::nullopt;
    effect.u_scale = calib::root_sum_of_squares(options.tracker_u_scale, index->u_n / index->n);
  }

  return effect;
}

std::array<double, 3> at_temperature(std::array<double, 3> reading_m,
                                     const EnvironmentEffect& effect,
                                     const EnvironmentUseOptions& options) {
  for (const ThermalAxis& thermal : options.thermal) {
    const std::size_t a = thermal.axis;
    if (a >= reading_m.size()) continue;
    const double fixed_m = thermal.config.fixed_m;
    reading_m[a] = fixed_m + (reading_m[a] - fixed_m) * effect.expansion_factor[a];
  }
  return reading_m;
}

void MeanEffect::take(const EnvironmentEffect& effect) {
  for (std::size_t a = 0; a < effect.expansion_factor.size(); ++a) {
    sum_.expansion_factor[a] += effect.expansion_factor[a];
    sum_.u_expansion_factor[a] += effect.u_expansion_factor[a];
  }
  sum_.u_scale += effect.u_scale;
  ++count_;
}

EnvironmentEffect MeanEffect::mean() const {
  if (count_ == 0) return {};
  EnvironmentEffect mean = sum_;
  for (double& factor : mean.expansion_factor) factor /= static_cast<double>(count_);
  for (double& u : mean.u_expansion_factor) u /= static_cast<double>(count_);
  mean.u_scale /= static_cast<double>(count_);
  return mean;
}

void correct_for_temperature(protocol::Snapshot& s, const EnvironmentUseOptions& options) {
  for (const ThermalAxis& thermal : options.thermal) {
    const std::size_t a = thermal.axis;
    if (a >= s.axis_count) continue;
    const double t_K =
        s.has_environment ? s.environment.temperature_K[thermal.config.temperature] : kNotAvailable;
    if (std::isnan(t_K)) {
      s.missing_mask = static_cast<std::uint8_t>(s.missing_mask | 1u << a);
      s.head.flags |= SampleFlag::AxisMissing;
      continue;
    }
    const calib::Expansion scale = expansion(thermal.config, t_K);
    const auto position = calib::true_position(s.position[a], thermal.config.fixed_m, scale);
    s.position[a] = position.value_m;
    s.velocity[a] *= calib::expansion_factor(scale);
    s.u_position[a] = calib::root_sum_of_squares(s.u_position[a], position.u_m);
  }
}

Result<calib::RefractiveIndex> index_of_air(const EnvironmentSample& environment,
                                            const AirConfig& config) {
  const calib::Air air{.temperature_K = environment.air_temperature_K,
                       .pressure_Pa = environment.air_pressure_Pa,
                       .relative_humidity = environment.relative_humidity,
                       .co2_ppm = config.co2_ppm,
                       .u_temperature_K = config.u_temperature_K,
                       .u_pressure_Pa = config.u_pressure_Pa,
                       .u_relative_humidity = config.u_relative_humidity,
                       .u_co2_ppm = config.u_co2_ppm};
  auto index = calib::refractive_index(air, config.wavelength_m, calib_of(config.equation));
  if (!index) return fail(ErrorCode::DataInsufficient, index.error().text);
  return *index;
}

void correct_for_air(protocol::Snapshot& s, const EnvironmentUseOptions& options) {
  if (!options.air.assumed_index || !s.has_tracker_point) return;
  if (s.has_environment) {
    if (const auto index = index_of_air(s.environment, options.air)) {
      const double factor = calib::distance_factor(*options.air.assumed_index, index->n);
      for (double& coordinate : s.tracker_point.p_tracker_m) coordinate *= factor;
      return;
    }
  }
  s.head.flags |= SampleFlag::PointInvalid;
  s.tracker_point.head.flags |= SampleFlag::PointInvalid;
}

}  // namespace abbe::daemon
