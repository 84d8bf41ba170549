#include "abbe/drivers/tracker/receiver.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>

#include "abbe/protocol/visit.hpp"

namespace abbe::drivers {
namespace {

using protocol::SampleFlag;
using protocol::TrackerPoint;

constexpr double kMetresPerMillimetre = 1e-3;
constexpr double kZeroCelsius_K = 273.15;
constexpr double kPascalsPerMillibar = 100.0;
constexpr double kPerPercent = 0.01;

/// Points measured before a beam break may arrive after its report. The beam has returned at the
/// first point after a gap of at least this duration, and of at least three point separations.
constexpr std::chrono::milliseconds kShortestBreak{20};
/// Period in which weather that does not change is passed on again: a check that refused it can
/// judge it again.
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

/// A point that arrives later than this was stored by a stalled network; the controller stores
/// less.
constexpr std::chrono::minutes kLongestDelay{1};

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
    : options_(options), clock_(options.clock) {
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
  clock_.reset();
  accepting_ = silenced_ = beam_lost_ = environment_known_ = false;
  points_came_ = false;
  times_.reset();
  last_.reset();
  weather_due_.reset();
  pending_flags_ = static_cast<protocol::SampleFlags>(SampleFlag::Restarted);
}

void TrackerReceiver::bytes_lost() ABBE_RT {
  framer_.reset();
  framer_.resync();
  silenced_ = false;
  pending_flags_ |= SampleFlag::GapBefore;
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
  if (!points_came_ || beam_lost_) return;
  beam_lost_ = true;
  ++counters_.beam_losses;
}

TrackerMessage TrackerReceiver::burst(std::size_t count) ABBE_RT {
  counters_.points += count;
  return TrackerBurst{std::span{points_}.first(count)};
}

/// The result is a mean over [arrival - delay - T, arrival - delay], with the duration T of the
/// measurement. Its time is the middle of this interval; delay and T each contribute a rectangular
/// distribution ([GUM] 4.3.7).
std::optional<TrackerMessage> TrackerReceiver::take(const emscon::SingleResult& result) ABBE_RT {
  if (!accepting_) {
    ++counters_.points_refused;
    return std::nullopt;
  }
  const auto delay = options_.clock.max_constant_delay;
  const double u_ns = std::hypot(static_cast<double>(options_.stationary_time.count()),
                                 static_cast<double>(delay.count())) /
                      (2.0 * std::numbers::sqrt3);
  TrackerPoint& point = points_[0];
  point = {};
  point.head.time = arrival_ - (options_.stationary_time + delay) / 2;
  point.head.u_time = std::chrono::nanoseconds{std::llround(u_ns)};
  point.p_tracker_m = metres(result.value);
  point.device_status = static_cast<std::int32_t>(result.status);
  if (!emscon::accepted(result.status))
    point.head.flags |= SampleFlag::DeviceError | SampleFlag::PointInvalid;
  if (!finite(result.value)) point.head.flags |= SampleFlag::PointInvalid;
  if (beam_lost_) point.head.flags |= SampleFlag::BeamReturned;
  beam_lost_ = false;
  mark_pending(point.head);
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
  for (std::size_t first = 0; first < result.size();) {
    const std::size_t end = judge_times(result, first);
    convert(result, first, end);
    if (end < result.size()) begin_time_base();
    first = end;
  }
  weather(result.head().environment, points_[0].head);
  return burst(result.size());
}

/// Without observations the clock model accepts any time: then a large step within the packet shows
/// it.
bool TrackerReceiver::is_ahead(protocol::DeviceTime t) const ABBE_RT {
  if (clock_.is_ahead(t, arrival_)) return true;
  return !clock_.has_observations() && times_.known() &&
         t - times_.last() > DeviceTimeCheck::kLargestStep;
}

/// Judges the points from `first` on, up to the first one on a new time base; returns its index, or
/// the number of points. The points that were refused until the new base was certain belong to it.
std::size_t TrackerReceiver::judge_times(const emscon::MultiResult& result,
                                         std::size_t first) ABBE_RT {
  for (std::size_t k = first; k < result.size(); ++k) {
    const auto t = result.point(k).time.to_device_time();
    verdicts_[k] = times_.judge(t, is_ahead(t));
    if (verdicts_[k] != TimeVerdict::Jumped) continue;
    const std::size_t agreed_before = DeviceTimeCheck::kAgreeing - 1;
    std::size_t begin = k;
    while (begin > first && k - begin < agreed_before &&
           verdicts_[begin - 1] == TimeVerdict::Refused)
      --begin;
    return begin;
  }
  return result.size();
}

/// The tracker's clock has jumped: a new clock model begins with the next point.
void TrackerReceiver::begin_time_base() ABBE_RT {
  times_.reset();
  clock_.restart();
  last_.reset();
  ++counters_.time_jumps;
  pending_flags_ |= SampleFlag::Restarted | SampleFlag::GapBefore;
}

/// Converts points of one time base. The last one that was not refused updates the clock model.
void TrackerReceiver::convert(const emscon::MultiResult& result, std::size_t first,
                              std::size_t end) ABBE_RT {
  for (std::size_t k = end; k-- > first;) {
    if (verdicts_[k] != TimeVerdict::Follows) continue;
    if (clock_.observe(result.point(k).time.to_device_time(), arrival_) ==
        ClockModel::Observed::Restarted) {
      last_.reset();
      pending_flags_ |= SampleFlag::Restarted;
    }
    break;
  }

  for (std::size_t k = first; k < end; ++k) {
    convert(result.point(k), result.head().status, points_[k]);
    if (verdicts_[k] == TimeVerdict::Refused) {
      refuse_time(points_[k]);
    } else {
      follow(points_[k]);
      mark_pending(points_[k].head);
    }
  }
}

void TrackerReceiver::convert(const emscon::MultiPoint& from, emscon::Status status,
                              TrackerPoint& to) ABBE_RT {
  to = {};
  to.device_time = from.time.to_device_time();
  to.p_tracker_m = metres(from.value);
  to.device_status = static_cast<std::int32_t>(from.status);
  const HostInstant instant = clock_.to_host(to.device_time);
  to.head.time = instant.time;
  to.head.u_time = instant.u_time;
  to.head.flags |= flag_of(from.status);
  if (!instant.settled) to.head.flags |= SampleFlag::ClockUnsettled;
  if (!finite(from.value)) to.head.flags |= SampleFlag::PointInvalid;
  if (!emscon::accepted(status))
    to.head.flags |= SampleFlag::DeviceError | SampleFlag::PointInvalid;
}

/// The time of the point does not fit those of the others. Its instant is then not known: it gets
/// its arrival, so that it does not lie in the future or hours ago.
void TrackerReceiver::refuse_time(TrackerPoint& point) ABBE_RT {
  ++counters_.time_disorder;
  point.head.flags |= SampleFlag::PointInvalid;
  const auto early = arrival_ - point.head.time;
  if (early >= -options_.clock.jump && early <= kLongestDelay) return;
  point.head.time = arrival_;
  point.head.u_time = kLongestDelay;
}

/// Compares the point with the previous one: a gap in the device time means lost points or a lost
/// beam.
void TrackerReceiver::follow(TrackerPoint& point) ABBE_RT {
  if (last_) mark_hole(point.device_time - *last_, point);
  last_ = point.device_time;
}

void TrackerReceiver::mark_hole(std::chrono::nanoseconds since_last, TrackerPoint& point) ABBE_RT {
  const auto separation = options_.time_separation;
  if (beam_lost_ &&
      since_last >= std::max<std::chrono::nanoseconds>(kShortestBreak, 3 * separation)) {
    beam_lost_ = false;
    point.head.flags |= SampleFlag::BeamReturned;
    return;
  }
  if (separation.count() == 0 || 2 * since_last <= 3 * separation) return;
  ++counters_.gaps;
  point.head.flags |= SampleFlag::GapBefore;
  point.head.lost_before = static_cast<std::uint32_t>(
      std::min<std::int64_t>((since_last + separation / 2) / separation - 1, INT32_MAX));
}

void TrackerReceiver::mark_pending(protocol::SampleHead& head) ABBE_RT {
  head.flags |= pending_flags_;
  pending_flags_ = 0;
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
