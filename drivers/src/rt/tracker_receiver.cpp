#include "abbe/drivers/tracker/receiver.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include "abbe/protocol/visit.hpp"

namespace abbe::drivers {
namespace {

using protocol::SampleFlag;
using protocol::TrackerPoint;

constexpr double kMetresPerMillimetre = 1e-3;
constexpr double kZeroCelsius_K = 273.15;
constexpr double kPascalsPerMillibar = 100.0;
constexpr double kPerPercent = 0.01;

/// Unchanged weather is passed on again with this period, so that a check that refused it can check
/// it again.
constexpr std::chrono::seconds kWeatherRepeated{10};

SampleFlag flag_of(emscon::PointStatus status) ABBE_RT {
  switch (status) {
    case emscon::PointStatus::Ok:
      return SampleFlag::None;
    case emscon::PointStatus::SpeedWarning:
      return SampleFlag::SpeedWarning;
    case emscon::PointStatus::SpeedExceeded:
      return SampleFlag::SpeedExceeded;
    case emscon::PointStatus::PrismError:
    case emscon::PointStatus::TriggerTimeViolation:
      break;
  }
  return SampleFlag::PointInvalid;  // also for unknown values
}

bool finite(const std::array<double, 3>& v) ABBE_RT {
  return std::isfinite(v[0]) && std::isfinite(v[1]) && std::isfinite(v[2]);
}

std::array<double, 3> metres(const std::array<double, 3>& mm) ABBE_RT {
  return {kMetresPerMillimetre * mm[0], kMetresPerMillimetre * mm[1], kMetresPerMillimetre * mm[2]};
}

/// Compares bit by bit, so that a NaN is equal to itself.
bool same(const emscon::Environment& a, const emscon::Environment& b) ABBE_RT {
  const auto bits = [](double v) { return std::bit_cast<std::uint64_t>(v); };
  return bits(a.temperature) == bits(b.temperature) && bits(a.pressure) == bits(b.pressure) &&
         bits(a.humidity) == bits(b.humidity);
}

}  // namespace

TrackerReceiver::TrackerReceiver(const TrackerReceiverOptions& options) noexcept
    : options_(options), times_(options.clock, options.time_separation) {
  framer_.resync();
}

void TrackerReceiver::push(std::span<const std::byte> bytes, protocol::HostTime arrival) ABBE_RT {
  arrival_ = arrival;
  if (bytes.empty()) {
    connection_began();
  } else if (!silenced_) {
    framer_.push(bytes);
  }
}

void TrackerReceiver::connection_began() ABBE_RT {
  framer_.reset();
  accepting_ = silenced_ = environment_known_ = false;
  points_came_ = false;
  times_.connection_began();
  weather_due_.reset();
}

void TrackerReceiver::bytes_lost() ABBE_RT {
  framer_.reset();
  framer_.resync();
  silenced_ = false;
  times_.data_lost();
}

TrackerCounters TrackerReceiver::counters() const ABBE_RT {
  TrackerCounters all = counters_;
  all.gaps = times_.counters().gaps;
  all.beam_losses = times_.counters().beam_losses;
  all.time_disorder = times_.counters().time_disorder;
  all.time_jumps = times_.counters().time_jumps;
  return all;
}

std::optional<TrackerMessage> TrackerReceiver::next() ABBE_RT {
  if (weather_due_) {
    const TrackerMessage message = *weather_due_;
    weather_due_.reset();
    return message;
  }
  while (!silenced_) {
    const auto packet = framer_.next();
    if (!packet && framer_.broken()) return protocol_error(std::nullopt, framer_.refused());
    if (!packet) return std::nullopt;
    if (const auto message = understand(*packet)) return message;
  }
  return std::nullopt;
}

std::optional<TrackerMessage> TrackerReceiver::understand(
    std::span<const std::byte> packet) ABBE_RT {
  const auto decoded = emscon::decode(packet);
  if (!decoded) return protocol_error(decoded.error(), packet);
  ++counters_.packets;
  return protocol::visit_trivial([this](const auto& p) { return take(p); }, *decoded);
}

TrackerMessage TrackerReceiver::protocol_error(std::optional<emscon::DecodeError> error,
                                               std::span<const std::byte> bytes) ABBE_RT {
  silenced_ = true;
  ++counters_.protocol_errors;
  TrackerProtocolError n;
  n.error = error;
  n.length = std::min(bytes.size(), n.first_bytes.size());
  std::copy_n(bytes.begin(), n.length, n.first_bytes.begin());
  return n;
}

std::optional<TrackerMessage> TrackerReceiver::take(const emscon::Answer& answer) ABBE_RT {
  if (emscon::command_of(answer) == emscon::Command::StartMeasurement &&
      emscon::accepted(emscon::status_of(answer))) {
    accepting_ = true;
  }
  return answer;
}

std::optional<TrackerMessage> TrackerReceiver::take(const emscon::ErrorResponse& error) ABBE_RT {
  beam_lost();
  return error;
}

std::optional<TrackerMessage> TrackerReceiver::take(const emscon::StatusChange& change) ABBE_RT {
  if (change.event == emscon::Event::MeasurementNotReady) beam_lost();
  return change;
}

/// Called for an unsolicited error. The manual does not state the error code of a broken beam, so
/// any unsolicited error while points arrive counts as a beam loss.
void TrackerReceiver::beam_lost() ABBE_RT {
  if (points_came_) times_.beam_lost();
}

TrackerMessage TrackerReceiver::burst(std::size_t count) ABBE_RT {
  counters_.points += count;
  return TrackerBurst{std::span{points_}.first(count)};
}

std::optional<TrackerMessage> TrackerReceiver::take(const emscon::SingleResult& result) ABBE_RT {
  if (!accepting_) {
    ++counters_.points_refused;
    return std::nullopt;
  }
  TrackerPoint& point = points_[0];
  point = {};
  point.p_tracker_m = metres(result.value);
  point.device_status = static_cast<std::int32_t>(result.status);
  if (!emscon::accepted(result.status))
    point.head.flags |= SampleFlag::DeviceError | SampleFlag::PointInvalid;
  if (!finite(result.value)) point.head.flags |= SampleFlag::PointInvalid;
  times_.assign_mean(point, options_.stationary_time, arrival_);
  points_came_ = true;
  weather(result.environment, point.head);

  return burst(1);
}

std::optional<TrackerMessage> TrackerReceiver::take(const emscon::MultiResult& result) ABBE_RT {
  if (result.size() == 0) return std::nullopt;
  if (!accepting_) {
    counters_.points_refused += result.size();
    return std::nullopt;
  }
  points_came_ = true;
  for (std::size_t k = 0; k < result.size(); ++k)
    convert(result.point(k), result.head().status, points_[k]);
  times_.assign(std::span{points_}.first(result.size()), arrival_);
  weather(result.head().environment, points_[0].head);
  return burst(result.size());
}

void TrackerReceiver::convert(const emscon::MultiPoint& from, emscon::Status status,
                              TrackerPoint& to) ABBE_RT {
  to = {};
  to.device_time = from.time.to_device_time();
  to.p_tracker_m = metres(from.value);
  to.device_status = static_cast<std::int32_t>(from.status);
  to.head.flags |= flag_of(from.status);
  if (!finite(from.value)) to.head.flags |= SampleFlag::PointInvalid;
  if (!emscon::accepted(status))
    to.head.flags |= SampleFlag::DeviceError | SampleFlag::PointInvalid;
}

void TrackerReceiver::weather(const emscon::Environment& environment,
                              const protocol::SampleHead& head) ABBE_RT {
  if (environment_known_ && same(environment, environment_) &&
      arrival_ - environment_sent_ < kWeatherRepeated)
    return;
  environment_ = environment;
  environment_known_ = true;
  environment_sent_ = arrival_;
  protocol::EnvironmentSample sample;
  sample.head.time = head.time;
  sample.head.u_time = head.u_time;
  sample.head.flags = head.flags & static_cast<protocol::SampleFlags>(SampleFlag::ClockUnsettled);
  sample.air_temperature_K = environment.temperature + kZeroCelsius_K;
  sample.air_pressure_Pa = environment.pressure * kPascalsPerMillibar;
  sample.relative_humidity = environment.humidity * kPerPercent;
  if (!options_.air_measured) sample.measured = 0;
  weather_due_ = sample;
}

}  // namespace abbe::drivers
