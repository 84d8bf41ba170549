#include "abbe/pipeline/sensor_checks.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "sensor_text.hpp"

namespace abbe::daemon {
namespace {

using calib::SensorDoubt;
using protocol::EnvironmentMask;
using protocol::EnvironmentSample;
using std::chrono::nanoseconds;

/// Largest time between two readings of twins that are compared, for two devices with slow periods.
/// The temperature of a machine changes by at most 0.3 K in this time.
constexpr std::chrono::minutes kComparableFor{1};

nanoseconds since_epoch(protocol::HostTime t) {
  return t.time_since_epoch();
}

bool comparable(nanoseconds a, nanoseconds b) {
  return (a > b ? a - b : b - a) <= kComparableFor;
}

}  // namespace

SensorChecks::SensorChecks(SensorCheckOptions options) : start_spread_K_(options.start_spread_K) {
  for (CheckedSensor& sensor : options.sensors) sensors_.push_back({.options = std::move(sensor)});
}

SensorChecks::Sensor* SensorChecks::at_place(std::size_t place) {
  const auto found = std::ranges::find_if(
      sensors_, [&](const Sensor& sensor) { return sensor.options.place == place; });
  return found == sensors_.end() ? nullptr : &*found;
}

/// Stores the reading and the expected range at the time when the doubt began, so that texts do not
/// change while the doubt lasts.
void SensorChecks::note(Sensor& sensor, SensorDoubt doubt, double reading, double lowest,
                        double highest) {
  if (sensor.doubt == doubt && doubt != SensorDoubt::Unconfirmed) return;
  const bool begins = sensor.doubt == SensorDoubt::None || sensor.doubt == SensorDoubt::Unconfirmed;
  if (begins && doubt != SensorDoubt::None && doubt != SensorDoubt::Unconfirmed) {
    ++sensor.doubts;
    sensor.latest = sensor.at;
  }
  sensor.doubt = doubt;
  sensor.reading = reading;
  sensor.lowest = lowest;
  sensor.highest = highest;
}

/// Compares the first reading with the other scales and the air, and with the last value before a
/// gap. A reading that is too far away leaves the sensor without a history, so that the next
/// reading is compared again.
void SensorChecks::compare_with_others(Sensor& sensor, double reading,
                                       calib::CheckedReading& verdict) {
  std::vector<double> others;
  if (std::isfinite(sensor.held.value)) others.push_back(sensor.held.value);
  for (const Sensor& other : sensors_)
    if (&other != &sensor && other.options.near_others && std::isfinite(other.usable))
      others.push_back(other.usable);
  if (!calib::far_from_others(reading, others, start_spread_K_)) return;
  const double median = calib::median_of(others);
  verdict = {SensorDoubt::Others, median - start_spread_K_, median + start_spread_K_};
  sensor.track.has_history = false;
  sensor.track.agreed = sensor.options.limits.agreeing - 1;
}

void SensorChecks::judge_alone(Sensor& sensor, double reading) {
  const bool is_first = !sensor.track.has_history;
  auto verdict = calib::check_reading(sensor.track, sensor.options.limits, reading, sensor.at);
  if (verdict.usable() && is_first && sensor.options.near_others && !sensor.accepted)
    compare_with_others(sensor, reading, verdict);
  if (verdict.usable()) sensor.accepted = false;
  sensor.usable = verdict.usable() ? reading : kNone;
  // judge_by_twin() decides then
  if (verdict.usable() && sensor.doubt == SensorDoubt::Twin) return;
  note(sensor, verdict.doubt, reading, verdict.lowest, verdict.highest);
}

/// Compares the two sensors of a pair. While they differ, both are in doubt, because it is not
/// known which one is wrong. The doubt ends only when a comparison agrees, not when one of them
/// sends nothing.
void SensorChecks::judge_by_twin(Sensor& sensor) {
  Sensor* const twin = sensor.options.twin ? at_place(*sensor.options.twin) : nullptr;
  if (twin == nullptr) return;
  Sensor& first = sensor.options.place < twin->options.place ? sensor : *twin;
  const double most = sensor.options.most_twin_difference;
  const bool both = std::isfinite(sensor.usable) && std::isfinite(twin->usable) &&
                    comparable(sensor.at, twin->at);
  // Until both sensors are in use, one comparison that differs is enough for a doubt, so that no
  // wrong value is used first.
  const bool in_use = std::isfinite(sensor.held.value) && std::isfinite(twin->held.value);
  const int confirmed = in_use ? 2 : 1;

  // The pair is compared only once per sample.
  const bool compared = sensor.at == twin->at && &sensor != &first;
  if (both && !compared) {
    (void)calib::twins_differ(first.twin_differs, sensor.usable, twin->usable, most);
    first.twins_doubted = first.twin_differs >= confirmed;
  } else if (!both) {
    first.twin_differs = 0;
  }

  for (auto [one, other] : {std::pair{&sensor, twin}, std::pair{twin, &sensor}}) {
    if (!std::isfinite(one->usable)) continue;  // the sensor is in doubt for another reason
    if (first.twins_doubted) {
      note(*one, SensorDoubt::Twin, one->usable, other->usable - most, other->usable + most);
    } else if (one->doubt == SensorDoubt::Twin) {
      note(*one, SensorDoubt::None, one->usable, kNone, kNone);
    }
  }
}

/// Sets the value that is used, and the present applied value.
void SensorChecks::use(Sensor& sensor) {
  const double before = sensor.used;
  const auto usable =
      sensor.doubt == SensorDoubt::None ? std::optional{sensor.usable} : std::nullopt;
  const double applied =
      calib::followed_value(sensor.applied, before, sensor.at, sensor.options.correction_per_s);
  // If a device reports that it has no value, the last value is not held.
  const auto hold = sensor.doubt == SensorDoubt::NoValue ? nanoseconds{0} : sensor.options.hold;
  sensor.used = calib::held_value(sensor.held, usable, sensor.at, hold);
  sensor.applied = {std::isnan(before) ? sensor.used : applied, sensor.at};
  sensor.judged = true;
  if (sensor.doubts > 0 && sensor.latest == sensor.at) sensor.latest_text = text_of(sensor);
}

CheckedEnvironment SensorChecks::checked(const EnvironmentSample& sample, EnvironmentMask mask) {
  CheckedEnvironment out{.sample = sample};
  const nanoseconds at = since_epoch(sample.head.time);
  std::vector<Sensor*> fresh;
  for (Sensor& sensor : sensors_) {
    if ((mask & mask_of_place(sensor.options.place)) == 0) continue;
    if (sensor.judged && at <= sensor.at) continue;
    sensor.at = at;
    judge_alone(sensor, value_at(sample, sensor.options.place));
    fresh.push_back(&sensor);
  }
  for (Sensor* const sensor : fresh) judge_by_twin(*sensor);
  for (Sensor* const sensor : fresh) use(*sensor);

  for (const Sensor& sensor : sensors_) {
    const std::size_t place = sensor.options.place;
    if ((mask & mask_of_place(place)) == 0) continue;
    value_at(out.sample, place) = sensor.used;
    if (place >= kFirstTemperaturePlace)
      out.applied[place - kFirstTemperaturePlace] = sensor.applied;
  }
  return out;
}

const SensorChecks::Sensor* SensorChecks::named(std::string_view name) const {
  const auto found = std::ranges::find_if(
      sensors_, [&](const Sensor& sensor) { return sensor.options.name == name; });
  return found == sensors_.end() ? nullptr : &*found;
}

Result<void> SensorChecks::check_acceptance(std::string_view name) const {
  const Sensor* const sensor = named(name);
  if (sensor == nullptr) {
    std::vector<std::string_view> names;
    for (const Sensor& known : sensors_) names.push_back(known.options.name);
    return fail(ErrorCode::Usage, fmt::format("no sensor \"{}\" is checked; known are {}", name,
                                              fmt::join(names, ", ")));
  }
  const auto refused = [&](std::string_view why) {
    return fail(ErrorCode::Refused, fmt::format("{}: {}", name, why));
  };
  switch (sensor->doubt) {
    case SensorDoubt::Jump:
    case SensorDoubt::Others:
      return {};
    case SensorDoubt::None:
      return refused("its readings are used: there is nothing to accept");
    case SensorDoubt::Unconfirmed:
      return refused("it is used when two readings agree: there is nothing to accept");
    case SensorDoubt::NoValue:
    case SensorDoubt::OutOfRange:
    case SensorDoubt::PowerOnValue:
      return refused("its reading itself cannot be right: see `abbe status`");
    case SensorDoubt::Twin:
      break;
  }
  const auto twin = std::ranges::find_if(
      sensors_, [&](const Sensor& other) { return other.options.place == sensor->options.twin; });
  const bool silent = twin == sensors_.end() || twin->doubt != SensorDoubt::Twin ||
                      !comparable(sensor->at, twin->at);
  if (silent) return {};
  return refused(
      fmt::format("it and its twin {} still differ: repair the wrong one, or remove "
                  "`twin` from [[sensors.limit]]",
                  twin->options.name));
}

void SensorChecks::accept(std::string_view name) {
  const Sensor* const found = named(name);
  if (found == nullptr) return;
  Sensor& sensor = sensors_[static_cast<std::size_t>(found - sensors_.data())];
  if (Sensor* const twin = sensor.options.twin ? at_place(*sensor.options.twin) : nullptr) {
    Sensor& first = sensor.options.place < twin->options.place ? sensor : *twin;
    first.twin_differs = 0;
    first.twins_doubted = false;
  }
  sensor.track = {};
  sensor.held = {};
  sensor.usable = kNone;
  sensor.accepted = true;
  if (sensor.doubt != SensorDoubt::None)
    note(sensor, SensorDoubt::Unconfirmed, sensor.reading, kNone, kNone);
}

void SensorChecks::shift(nanoseconds by) {
  for (Sensor& sensor : sensors_) {
    sensor.track.at += by;
    if (sensor.track.doubted_since) *sensor.track.doubted_since += by;
    sensor.held.at += by;
    sensor.applied.at += by;
    sensor.at += by;
  }
}

void SensorChecks::note_future(EnvironmentMask mask, protocol::HostTime taken, nanoseconds ahead) {
  for (Sensor& sensor : sensors_) {
    if ((mask & mask_of_place(sensor.options.place)) == 0) continue;
    ++sensor.doubts;
    sensor.latest = since_epoch(taken);
    sensor.latest_text = future_text(sensor.options, ahead);
  }
}

EnvironmentMask SensorChecks::mask_of(std::string_view device) const {
  EnvironmentMask mask = 0;
  for (const Sensor& sensor : sensors_)
    if (sensor.options.device == device) mask |= mask_of_place(sensor.options.place);
  return mask;
}

double SensorChecks::applied(const CheckedEnvironment& checked, std::size_t channel,
                             protocol::HostTime t) const {
  const auto found = std::ranges::find_if(sensors_, [&](const Sensor& sensor) {
    return sensor.options.place == kFirstTemperaturePlace + channel;
  });
  const double target = checked.sample.temperature_K[channel];
  if (found == sensors_.end()) return target;
  return calib::followed_value(checked.applied[channel], target, since_epoch(t),
                               found->options.correction_per_s);
}

std::string SensorChecks::text_of(const Sensor& sensor) const {
  DoubtedReading doubted{.doubt = sensor.doubt,
                         .held = std::isfinite(sensor.used),
                         .reading = sensor.reading,
                         .lowest = sensor.lowest,
                         .highest = sensor.highest,
                         .used = sensor.used};
  if (sensor.options.twin)
    for (const Sensor& other : sensors_)
      if (other.options.place == *sensor.options.twin) doubted.twin = other.options.name;
  return daemon::text_of(sensor.options, doubted);
}

std::vector<SensorFinding> SensorChecks::findings() const {
  std::vector<SensorFinding> out;
  for (const Sensor& sensor : sensors_) {
    if (!sensor.judged || sensor.doubt == SensorDoubt::None) continue;
    out.push_back({.sensor = sensor.options.name,
                   .device = sensor.options.device,
                   .axes = sensor.options.axes,
                   .doubt = sensor.doubt,
                   .held = std::isfinite(sensor.used),
                   .text = text_of(sensor)});
  }
  return out;
}

std::vector<SensorDoubts> SensorChecks::doubts() const {
  std::vector<SensorDoubts> out;
  for (const Sensor& sensor : sensors_)
    if (sensor.doubts > 0)
      out.push_back({.device = sensor.options.device,
                     .count = sensor.doubts,
                     .latest = protocol::HostTime{sensor.latest},
                     .latest_text = sensor.latest_text});
  return out;
}

}  // namespace abbe::daemon
