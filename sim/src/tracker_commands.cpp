/// Execution of each command: answers, refusals and changes of the state.

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

#include "abbe/sim/tracker_device.hpp"

namespace abbe::sim {
namespace {

constexpr std::chrono::seconds kReflectorSearch{1};

struct Reflector {
  std::int32_t id;
  std::u16string_view name;
  emscon::TargetType type;
};
constexpr std::array kKnownReflectors{
    Reflector{0, u"SMR 1.5 inch", emscon::TargetType::CornerCube},
    Reflector{1, u"SMR 0.5 inch", emscon::TargetType::CornerCube},
    Reflector{4, u"Cat eye 75 mm", emscon::TargetType::CatEye},
};

template <class T>
const T* as(const emscon::Request& request) {
  return std::get_if<T>(&request);
}

}  // namespace

std::chrono::nanoseconds TrackerDevice::latency(const emscon::Request& request) const {
  if (as<emscon::Initialize>(request)) return options_.command_latency + options_.initialize_time;
  if (as<emscon::FindReflector>(request) || as<emscon::GoBirdBath>(request) ||
      as<emscon::GoPosition>(request)) {
    return options_.command_latency + kReflectorSearch;
  }
  return options_.command_latency;
}

void TrackerDevice::carry_out(const emscon::Request& request, HostTime at) {
  if (answer_query(request, at)) return;
  const emscon::Status status = outcome(request, at);
  send(emscon::Answer{emscon::Acknowledge{command_of(request), status}});
  if (status == emscon::Status::Ok && as<emscon::Initialize>(request))
    send_event(emscon::Event::InitStatusChanged);
}

emscon::Status TrackerDevice::outcome(const emscon::Request& request, HostTime at) {
  using emscon::Status;
  if (as<emscon::Initialize>(request)) {
    if (at < warm_at_) return Status::NotWarmedUp;
    initialise(at);
    return Status::Ok;
  }

  if (as<emscon::StartMeasurement>(request)) return start_measurement(at);
  if (as<emscon::StopMeasurement>(request)) {
    if (stream_) emit_burst(at);
    stream_.reset();
    single_due_.reset();
    return Status::Ok;
  }

  if (const auto* r = as<emscon::SetUnits>(request)) return units_ = r->units, Status::Ok;
  if (const auto* r = as<emscon::SetSystemSettings>(request))
    return settings_ = r->settings, Status::Ok;
  if (const auto* r = as<emscon::SetEnvironmentParams>(request))
    return set_environment_ = r->environment, Status::Ok;
  if (const auto* r = as<emscon::SetRefractionParams>(request))
    return refraction_ = r->refraction, Status::Ok;
  if (const auto* r = as<emscon::SetStationaryModeParams>(request))
    return stationary_ = *r, Status::Ok;
  if (const auto* r = as<emscon::SetMeasurementMode>(request)) return set_mode(r->mode);

  if (const auto* r = as<emscon::SetContinuousTimeModeParams>(request)) {
    if (r->time_separation_ms < 1 || r->number_of_points < 0) return Status::WrongParameter1;
    return continuous_ = *r, Status::Ok;
  }

  if (const auto* r = as<emscon::SetCoordinateSystemType>(request)) {
    using enum emscon::CoordinateSystem;
    if (r->type != RightHanded && r->type != LeftHandedX) return Status::NotImplemented;
    return coordinates_ = r->type, Status::Ok;
  }

  if (const auto* r = as<emscon::SetReflector>(request)) {
    const bool known =
        std::ranges::any_of(kKnownReflectors, [&](auto& k) { return k.id == r->internal_id; });
    if (!known) return Status::WrongParameter1;
    if (std::exchange(reflector_, r->internal_id) != r->internal_id)
      send_event(emscon::Event::ReflectorChanged);
    return Status::Ok;
  }

  if (const auto* r = as<emscon::SetStatisticMode>(request)) return statistics_ = *r, Status::Ok;
  if (as<emscon::SetContinuousDistanceModeParams>(request)) return Status::NotImplemented;
  if (const auto* r = as<emscon::SetTransformation>(request))
    return transformation_ = *r, Status::Ok;
  if (const auto* r = as<emscon::SetStationOrientation>(request))
    return orientation_ = *r, Status::Ok;
  if (const auto* r = as<emscon::SetSearchParams>(request)) return search_ = *r, Status::Ok;
  if (const auto* r = as<emscon::SetLongSystemParameter>(request))
    return long_parameters_[r->parameter] = r->value, Status::Ok;

  if (const auto* r = as<emscon::SetTriggerSource>(request)) {
    return r->source == emscon::TriggerSource::Internal ? Status::Ok : Status::NotImplemented;
  }

  if (const auto* r = as<emscon::FindReflector>(request); r && !(r->approximate_distance > 0.0))
    return Status::WrongParameter1;
  if (as<emscon::FindReflector>(request) || as<emscon::GoBirdBath>(request) ||
      as<emscon::GoPosition>(request)) {
    return initialised_ ? move_beam(at) : Status::TrackerNotInitialized;
  }

  // Orientation, search and long parameters are stored and have no effect. For example, the packet
  // rate is that of real controllers, which does not depend on the requested rate.
  return Status::Ok;
}

/// Initialize moves the head: the beam is lost, and a running measurement ends.
void TrackerDevice::initialise(HostTime at) {
  initialised_ = true;
  ++initializations_;
  if (stream_ || single_due_) send_event(emscon::Event::MeasurementNotReady);
  stream_.reset();
  single_due_.reset();
  if (options_.fetch_beam.count() == 0) return;
  distance_set_ = false;
  beam_back_ = at + options_.fetch_beam;
}

/// Moves the beam to the reflector; the beam is locked on it afterwards.
emscon::Status TrackerDevice::move_beam(HostTime at) {
  if (stream_ || single_due_) return emscon::Status::UsageConflict;
  if (reflector_away_.holds(at)) {  // the head has turned away from its previous target
    distance_set_ = false;
    beam_back_ = std::max(beam_back_.value_or(at), reflector_away_.until);
    return emscon::Status::NoDistanceSet;
  }
  ++beam_moves_;
  beam_broken_.until = std::min(beam_broken_.until, at);
  if (beam_back_) return_beam();
  return emscon::Status::Ok;
}

emscon::Status TrackerDevice::set_mode(emscon::MeasurementMode mode) {
  if (mode != emscon::MeasurementMode::Stationary &&
      mode != emscon::MeasurementMode::ContinuousTime) {
    return emscon::Status::NotImplemented;
  }
  if (stream_) return emscon::Status::UsageConflict;
  if (mode != mode_) send_event(emscon::Event::MeasurementModeChanged);
  mode_ = mode;
  return emscon::Status::Ok;
}

emscon::Status TrackerDevice::start_measurement(HostTime at) {
  if (!initialised_) return emscon::Status::TrackerNotInitialized;
  if (!distance_set_) return emscon::Status::NoDistanceSet;
  if (beam_back_) return emscon::Status::MeasurementNotReady;
  if (stream_ || single_due_) return emscon::Status::InternalProcessActive;

  if (mode_ == emscon::MeasurementMode::Stationary) {
    single_due_ = at + std::chrono::milliseconds{stationary_.measurement_time_ms};
    return emscon::Status::Ok;
  }

  const std::chrono::nanoseconds separation =
      std::chrono::milliseconds{continuous_.time_separation_ms};
  const DeviceTime now = device_time(options_.model, power_on_, at);

  if (!grid_ || grid_->separation != separation) {
    grid_ = Grid{DeviceTime{std::chrono::ceil<std::chrono::microseconds>(now.time_since_epoch())},
                 separation};
    noise_base_ = noise_next_;
  }

  const auto steps = (now - grid_->first + separation - std::chrono::nanoseconds{1}) / separation;
  Stream stream{grid_->first + steps * separation, separation,
                at + burst_interval(options_.model.seed, bursts_++), 0};
  stream.points_left = continuous_.number_of_points > 0
                           ? static_cast<std::uint64_t>(continuous_.number_of_points)
                           : ~std::uint64_t{0};
  if (!first_stream_) first_stream_ = host_time(options_.model, power_on_, stream.next_point);
  stream_ = stream;

  return emscon::Status::Ok;
}

bool TrackerDevice::answer_setting(const emscon::Request& request) {
  using emscon::Status;
  const auto reply = [this](const auto& answer) { return send(emscon::Answer{answer}), true; };
  if (as<emscon::GetTransformation>(request))
    return reply(emscon::TransformationAnswer{Status::Ok, transformation_});
  if (as<emscon::GetStationOrientation>(request))
    return reply(emscon::StationOrientationAnswer{Status::Ok, orientation_});
  if (as<emscon::GetMeasurementMode>(request))
    return reply(emscon::MeasurementModeAnswer{Status::Ok, {mode_}});
  if (as<emscon::GetCoordinateSystemType>(request))
    return reply(emscon::CoordinateSystemTypeAnswer{Status::Ok, {coordinates_}});
  if (as<emscon::GetStationaryModeParams>(request))
    return reply(emscon::StationaryModeParamsAnswer{Status::Ok, stationary_});
  if (as<emscon::GetContinuousTimeModeParams>(request))
    return reply(emscon::ContinuousTimeModeParamsAnswer{Status::Ok, continuous_});
  if (as<emscon::GetSearchParams>(request))
    return reply(emscon::SearchParamsAnswer{Status::Ok, search_});
  if (as<emscon::GetStatisticMode>(request))
    return reply(emscon::StatisticModeAnswer{Status::Ok, statistics_});

  return false;
}

bool TrackerDevice::answer_query(const emscon::Request& request, HostTime at) {
  if (as<emscon::GetSystemStatus>(request)) {
    emscon::SystemStatusAnswer a;
    a.tracker_processor = initialised_ ? emscon::TrackerProcessorStatus::Initialised
                                       : emscon::TrackerProcessorStatus::CompensationSet;
    a.laser = at < warm_at_ ? emscon::LaserStatus::Heating : emscon::LaserStatus::Ready;
    a.version_major = 3;
    a.version_minor = 6;
    a.weather_monitor = settings_.weather_monitor;
    a.serial_number = 1;
    return send(emscon::Answer{a}), true;
  }

  if (as<emscon::GetTrackerStatus>(request)) {
    emscon::TrackerStatusAnswer a;
    a.tracker = !initialised_ || beam_back_ ? emscon::TrackerStatus::NotReady
                : stream_                   ? emscon::TrackerStatus::Busy
                                            : emscon::TrackerStatus::Ready;
    return send(emscon::Answer{a}), true;
  }

  if (as<emscon::GetUnits>(request))
    return send(emscon::Answer{emscon::UnitsAnswer{emscon::Status::Ok, units_}}), true;
  if (as<emscon::GetEnvironmentParams>(request)) {
    return send(emscon::Answer{emscon::EnvironmentAnswer{emscon::Status::Ok, environment(at)}}),
           true;
  }

  if (as<emscon::GetRefractionParams>(request)) {
    return send(emscon::Answer{emscon::RefractionAnswer{emscon::Status::Ok, refraction_}}), true;
  }

  if (as<emscon::GetReflector>(request)) {
    return send(emscon::Answer{emscon::ReflectorAnswer{emscon::Status::Ok, reflector_}}), true;
  }

  if (as<emscon::GetReflectors>(request)) {
    for (const Reflector& known : kKnownReflectors) {
      emscon::ReflectorsAnswer a;
      a.total = static_cast<std::int32_t>(kKnownReflectors.size());
      a.internal_id = known.id;
      a.target_type = known.type;
      std::copy(known.name.begin(), known.name.end(), a.name.begin());
      send(emscon::Answer{a});
    }
    return true;
  }

  if (as<emscon::GetSystemSettings>(request)) {
    return send(emscon::Answer{emscon::SystemSettingsAnswer{emscon::Status::Ok, settings_}}), true;
  }

  if (const auto* r = as<emscon::GetLongSystemParameter>(request)) {
    const auto set = long_parameters_.find(r->parameter);
    const std::int32_t value = set == long_parameters_.end() ? 3 : set->second;
    return send(emscon::Answer{
               emscon::LongSystemParameterAnswer{emscon::Status::Ok, r->parameter, value}}),
           true;
  }

  if (answer_setting(request)) return true;
  if (as<emscon::GetMeasurementStatusInfo>(request)) {
    using Bit = emscon::MeasurementStatusBit;
    emscon::MeasurementStatusInfoAnswer a;
    const auto bit = [](Bit b) { return static_cast<std::int32_t>(b); };
    a.bits = bit(Bit::Tracker) | bit(Bit::Compensation) | bit(Bit::Adm) |
             bit(Bit::AdmCompensation) | bit(Bit::Face1);
    if (!beam_back_) a.bits |= bit(Bit::ReflectorFound);
    if (initialised_) a.bits |= bit(Bit::Initialised);
    return send(emscon::Answer{a}), true;
  }

  if (as<emscon::GetObjectTemperature>(request)) {
    return send(emscon::Answer{
               emscon::ObjectTemperatureAnswer{emscon::Status::Ok, environment(at).temperature}}),
           true;
  }

  if (as<emscon::GetTriggerBoardInfo>(request))
    return send(emscon::Answer{emscon::TriggerBoardInfoAnswer{}}), true;
  if (as<emscon::GetTrackerInfo>(request)) {
    emscon::TrackerInfoAnswer a;
    const std::u16string_view name = u"abbe-sim";
    std::copy(name.begin(), name.end(), a.name.begin());
    a.serial_number = 1;
    return send(emscon::Answer{a}), true;
  }

  return false;
}

}  // namespace abbe::sim
