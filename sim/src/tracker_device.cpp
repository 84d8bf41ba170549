#include "abbe/sim/tracker_device.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

namespace abbe::sim {
namespace {

constexpr double kWeatherThreshold_K = 0.2;  // smallest change that causes an event
// With this many points a packet of type 3 stays below the largest packet size. A packet of type 10
// is limited to kMaxExtendedMultiPoints as well.
constexpr std::size_t kPointsPerPacket = 1500;

double length_per_metre(emscon::LengthUnit unit) {
  switch (unit) {
    case emscon::LengthUnit::Metre:
      return 1.0;
    case emscon::LengthUnit::Millimetre:
      return 1e3;
    case emscon::LengthUnit::Micrometre:
      return 1e6;
    case emscon::LengthUnit::Foot:
      return 1.0 / 0.3048;
    case emscon::LengthUnit::Yard:
      return 1.0 / 0.9144;
    case emscon::LengthUnit::Inch:
      return 1.0 / 0.0254;
  }

  return 1e3;
}

double pressure_per_mbar(emscon::PressureUnit unit) {
  switch (unit) {
    case emscon::PressureUnit::Millibar:
    case emscon::PressureUnit::Hectopascal:
      return 1.0;
    case emscon::PressureUnit::Kilopascal:
      return 0.1;
    case emscon::PressureUnit::MillimetreOfMercury:
      return 100.0 / 133.322387415;
    case emscon::PressureUnit::PoundPerSquareInch:
      return 100.0 / 6894.757293168;
    case emscon::PressureUnit::InchOfWater:
      return 100.0 / 249.08891;
    case emscon::PressureUnit::InchOfMercury:
      return 100.0 / 3386.388640341;
  }

  return 1.0;
}

}  // namespace

TrackerDevice::TrackerDevice(const TrackerOptions& options, const VirtualMachine& machine,
                             HostTime now)
    : options_(options),
      machine_(machine),
      power_on_(now),
      warm_at_(now + options.warm_up),
      warm_announced_(options.warm_up.count() == 0),
      announced_temperature_C_(options.air_temperature_C) {}

void TrackerDevice::send_event(emscon::Event event) {
  if (settings_.send_unsolicited_messages) send(emscon::StatusChange{event});
}

std::vector<std::byte> TrackerDevice::take_output() {
  if (stall_until_) return {};
  return std::exchange(out_, {});
}

// ------------------------------------------------------------------------------------------
// connection

void TrackerDevice::connected(HostTime now) {
  advance(now);
  reset_session();
  connected_ = true;
  if (std::exchange(announce_start_, false))
    send(emscon::StatusChange{emscon::Event::ServerStarted});
}

void TrackerDevice::disconnected() {
  reset_session();
  connected_ = false;
}

void TrackerDevice::reset_session() {
  framer_.reset();
  out_.clear();
  pending_.reset();
  stream_.reset();  // without a client nothing is measured
  single_due_.reset();
  wants_close_ = false;
}

void TrackerDevice::receive(std::span<const std::byte> bytes, HostTime now) {
  advance(now);
  if (now < mute_until_) return;
  while (!bytes.empty() && !framer_.broken()) {
    bytes = bytes.subspan(framer_.push(bytes));
    while (const auto packet = framer_.next()) on_packet(*packet, now);
  }
  if (framer_.broken()) wants_close_ = true;  // the client does not use TPI
}

void TrackerDevice::on_packet(std::span<const std::byte> packet, HostTime now) {
  const auto request = emscon::decode_request(packet);
  if (!request) {
    emscon::Acknowledge refusal;
    if (packet.size() >= 12) {
      std::int32_t command = 0;
      std::memcpy(&command, packet.data() + 8, sizeof command);
      refusal.command = static_cast<emscon::Command>(command);
    }
    refusal.status = request.error() == emscon::DecodeError::UnknownCommand
                         ? emscon::Status::NotImplemented
                         : emscon::Status::WrongParameter;
    return send(emscon::Answer{refusal});
  }

  if (pending_ || now < busy_until_) {
    return send(
        emscon::Answer{emscon::Acknowledge{command_of(*request), emscon::Status::ServerBusy}});
  }

  pending_ = Command{*request, now + latency(*request)};
}

HostTime TrackerDevice::next_due() const {
  HostTime due = HostTime::max();
  if (pending_) due = std::min(due, pending_->due);
  if (stream_) due = std::min(due, stream_->next_burst);
  if (single_due_) due = std::min(due, *single_due_);
  if (!warm_announced_) due = std::min(due, warm_at_);
  if (beam_back_) due = std::min(due, *beam_back_);
  if (booting_until_) due = std::min(due, *booting_until_);
  if (stall_until_) due = std::min(due, *stall_until_);
  return due;
}

void TrackerDevice::advance(HostTime now) {
  for (HostTime due = next_due(); due <= now; due = next_due()) step(due);
}

void TrackerDevice::step(HostTime at) {
  if (booting_until_ && at >= *booting_until_) return finish_boot(at);
  if (!warm_announced_ && at >= warm_at_) {
    warm_announced_ = true;
    return send_event(emscon::Event::LaserWarmedUp);
  }

  if (stall_until_ && at >= *stall_until_) return stall_until_.reset();
  if (pending_ && at >= pending_->due) {
    const Command command = *std::exchange(pending_, std::nullopt);
    if (at >= mute_until_) carry_out(command.request, at);
    return;
  }

  if (stream_ && at >= stream_->next_burst) {
    stream_->next_burst = at + burst_interval(options_.model.seed, bursts_++);
    emit_burst(at);
    return check_weather(at);
  }

  if (single_due_ && at >= *single_due_) return emit_single(at);
  if (beam_back_ && at >= *beam_back_) return_beam();
}

void TrackerDevice::return_beam() {
  if (!settings_.keep_last_position) stream_.reset();
  beam_back_.reset();
  distance_set_ = true;
  send_event(emscon::Event::DistanceSet);
  send_event(emscon::Event::MeasurementReady);
}

void TrackerDevice::finish_boot(HostTime at) {
  booting_until_.reset();
  power_on_ = at;
  warm_at_ = at + options_.warm_up;
  warm_announced_ = options_.warm_up.count() == 0;
  initialised_ = false;
  distance_set_ = true;
  beam_back_.reset();
  grid_.reset();
  settings_ = {};
  units_ = {};
  mode_ = emscon::MeasurementMode::Stationary;
  announce_start_ = true;
}

// ------------------------------------------------------------------------------------------
// results

std::optional<emscon::MultiPoint> TrackerDevice::point_at(DeviceTime t) {
  const HostTime at = host_time(options_.model, power_on_, t);
  const auto index = static_cast<std::uint64_t>((t - grid_->first) / grid_->separation);
  noise_next_ = std::max(noise_next_, noise_base_ + index + 1);
  const TrackerView view = observe(options_.model, machine_, at, noise_base_ + index);
  if (!view.has_target) return std::nullopt;
  Eigen::Vector3d p = length_per_metre(units_.length) * view.p_tracker_m;
  // Only the translation of a transformation is simulated: enough to detect a transformation that
  // was left switched on.
  if (settings_.apply_transformation) p += Eigen::Vector3d::Map(transformation_.translation.data());
  if (coordinates_ == emscon::CoordinateSystem::LeftHandedX) p.x() = -p.x();
  return emscon::MultiPoint{
      status_of(view.speed, at), emscon::TrackerClockReading::from(t), {p.x(), p.y(), p.z()}};
}

emscon::PointStatus TrackerDevice::status_of(BeamSpeed speed, HostTime at) const {
  if (prism_fault_.holds(at)) return emscon::PointStatus::PrismError;
  if (speed_fault_.holds(at) || speed == BeamSpeed::Exceeded)
    return emscon::PointStatus::SpeedExceeded;
  return speed == BeamSpeed::Warning ? emscon::PointStatus::SpeedWarning : emscon::PointStatus::Ok;
}

void TrackerDevice::emit_burst(HostTime at) {
  std::vector<emscon::MultiPoint> points;
  const DeviceTime until = device_time(options_.model, power_on_, at - options_.delay);
  for (; stream_->next_point <= until && stream_->points_left > 0;
       stream_->next_point += stream_->separation) {
    const HostTime measured = host_time(options_.model, power_on_, stream_->next_point);
    if (beam_broken_.holds(measured)) continue;
    const auto point = point_at(stream_->next_point);
    if (!point) continue;
    points.push_back(*point);
    --stream_->points_left;
  }

  if (at >= mute_until_) emit_points(points);
  if (stream_->points_left > 0) return;
  stream_.reset();
  send_event(emscon::Event::MeasurementCountReached);
}

void TrackerDevice::emit_points(std::span<const emscon::MultiPoint> points) {
  while (!points.empty()) {
    const bool extended = statistics_.continuous == emscon::StatisticMode::Extended;
    const std::size_t most =
        extended ? std::min(kPointsPerPacket, emscon::kMaxExtendedMultiPoints) : kPointsPerPacket;
    const auto part = points.first(std::min(points.size(), most));
    emscon::MultiHead head;
    head.environment =
        environment(host_time(options_.model, power_on_, part.back().time.to_device_time()));
    if (extended) {
      std::vector<emscon::ExtendedMultiPoint> wide(part.size());
      std::transform(part.begin(), part.end(), wide.begin(), [](const emscon::MultiPoint& p) {
        return emscon::ExtendedMultiPoint{p, {}};
      });
      send(head, std::span<const emscon::ExtendedMultiPoint>(wide));
    } else {
      send(head, part);
    }
    points_sent_ += part.size();
    points = points.subspan(part.size());
  }
}

void TrackerDevice::emit_single(HostTime at) {
  single_due_.reset();
  // The result is the mean of the points that a rate of 1 kHz gives in the measurement time.
  const auto n =
      static_cast<std::uint64_t>(std::max<std::int32_t>(stationary_.measurement_time_ms, 1));
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  std::uint64_t measured = 0;

  for (std::uint64_t i = 0; i < n; ++i) {
    const HostTime t = at - std::chrono::milliseconds{n - i};
    const TrackerView view = observe(options_.model, machine_, t, noise_next_++);
    sum += view.p_tracker_m;
    if (view.has_target) ++measured;
  }

  if (measured == 0)
    return send(emscon::ErrorResponse{emscon::Command::StartMeasurement, emscon::Status::Unknown});
  const Eigen::Vector3d mean =
      length_per_metre(units_.length) / static_cast<double>(measured) * sum;
  emscon::SingleResult result;
  result.value = {mean.x(), mean.y(), mean.z()};
  result.environment = environment(at);
  send(result);
}

// ------------------------------------------------------------------------------------------
// weather and faults

double TrackerDevice::air_temperature_C(HostTime at) const {
  return options_.air_temperature_C + weather_step_K_ +
         options_.air_drift_K_per_hour * ns_to_seconds(at - power_on_) / 3600.0;
}

emscon::Environment TrackerDevice::environment(HostTime at) const {
  if (settings_.weather_monitor == emscon::WeatherMonitor::None) return set_environment_;
  const double celsius = air_temperature_C(at);
  const bool fahrenheit = units_.temperature == emscon::TemperatureUnit::Fahrenheit;
  return {fahrenheit ? celsius * 1.8 + 32.0 : celsius,
          options_.air_pressure_mbar * pressure_per_mbar(units_.pressure),
          options_.air_humidity_percent};
}

void TrackerDevice::check_weather(HostTime at) {
  const double celsius = air_temperature_C(at);
  if (std::abs(celsius - announced_temperature_C_) < kWeatherThreshold_K) return;
  announced_temperature_C_ = celsius;
  send_event(emscon::Event::EnvironmentParamsChanged);
  send_event(emscon::Event::RefractionParamsChanged);
}

void TrackerDevice::inject(const Fault& fault, HostTime now) {
  advance(now);
  const HostTime until = now + seconds_to_ns(fault.duration_s);
  switch (fault.kind) {
    case FaultKind::BeamBreak:
      beam_broken_ = {now, until};
      beam_back_ = until;
      if (settings_.send_unsolicited_messages) {
        send(emscon::ErrorResponse{emscon::Command::StartMeasurement, emscon::Status::Unknown});
      }
      return send_event(emscon::Event::MeasurementNotReady);
    case FaultKind::SpeedExceeded:
      speed_fault_ = {now, until};
      return;
    case FaultKind::PrismError:
      prism_fault_ = {now, until};
      return;
    case FaultKind::ReflectorAway:
      reflector_away_ = {now, until};
      return;
    case FaultKind::Stall:
      stall_until_ = until;
      return;
    case FaultKind::Mute:
      mute_until_ = until;
      return;
    case FaultKind::Busy:
      busy_until_ = until;
      return;
    case FaultKind::Reboot:
      send(emscon::StatusChange{emscon::Event::ServerClosing});
      stream_.reset();
      pending_.reset();
      wants_close_ = true;
      booting_until_ = until;
      return;
    case FaultKind::Disconnect:
      wants_close_ = true;
      return;
    case FaultKind::Weather:
      weather_step_K_ += fault.value;
      return check_weather(now);
    case FaultKind::TrackerGarbage:
      out_.insert(out_.end(), 64, std::byte{0xA5});
      return;
    default:
      return;  // this is not a fault of a tracker
  }
}

}  // namespace abbe::sim
