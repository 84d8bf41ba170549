#pragma once
/// Requests of a client to an emScon controller (packet type 0, client to controller). Lengths,
/// angles, temperatures, pressures and humidity have the units set by SetUnits, so their names
/// contain no unit. The driver always sets mm, rad, Celsius, mbar and percent. Pure,
/// allocation-free, accepts any bytes.

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <tl/expected.hpp>
#include <variant>

#include "abbe/protocol/emscon/types.hpp"

namespace abbe::protocol::emscon {

/// A request without parameters.
template <Command kId>
struct BareRequest {
  static constexpr Command kCommand = kId;
};
using GetSystemStatus = BareRequest<Command::GetSystemStatus>;
using GetTrackerStatus = BareRequest<Command::GetTrackerStatus>;
using GetUnits = BareRequest<Command::GetUnits>;
using Initialize = BareRequest<Command::Initialize>;
using GetEnvironmentParams = BareRequest<Command::GetEnvironmentParams>;
using GetRefractionParams = BareRequest<Command::GetRefractionParams>;
using GetStationOrientation = BareRequest<Command::GetStationOrientation>;
using GetTransformation = BareRequest<Command::GetTransformation>;
using GetMeasurementMode = BareRequest<Command::GetMeasurementMode>;
using GetCoordinateSystemType = BareRequest<Command::GetCoordinateSystemType>;
using GetStationaryModeParams = BareRequest<Command::GetStationaryModeParams>;
using GetContinuousTimeModeParams = BareRequest<Command::GetContinuousTimeModeParams>;
using GetContinuousDistanceModeParams = BareRequest<Command::GetContinuousDistanceModeParams>;
using GetSearchParams = BareRequest<Command::GetSearchParams>;
using GetStatisticMode = BareRequest<Command::GetStatisticMode>;
using GetReflector = BareRequest<Command::GetReflector>;
using GetReflectors = BareRequest<Command::GetReflectors>;
using GetSystemSettings = BareRequest<Command::GetSystemSettings>;
using StartMeasurement = BareRequest<Command::StartMeasurement>;
using StopMeasurement = BareRequest<Command::StopMeasurement>;
using GoBirdBath = BareRequest<Command::GoBirdBath>;
using GetMeasurementStatusInfo = BareRequest<Command::GetMeasurementStatusInfo>;
using GetObjectTemperature = BareRequest<Command::GetObjectTemperature>;
using GetTriggerBoardInfo = BareRequest<Command::GetTriggerBoardInfo>;
using GetTrackerInfo = BareRequest<Command::GetTrackerInfo>;

/// Field groups that a request and an answer share.
struct Units {
  LengthUnit length = LengthUnit::Millimetre;
  AngleUnit angle = AngleUnit::Radian;
  TemperatureUnit temperature = TemperatureUnit::Celsius;
  PressureUnit pressure = PressureUnit::Millibar;
  HumidityUnit humidity = HumidityUnit::RelativePercent;
};
struct Environment {
  double temperature = 20.0;
  double pressure = 1013.25;
  double humidity = 50.0;
};
struct Refraction {
  double n_interferometer = 1.0;
  double n_adm = 1.0;
};
struct SystemSettings {
  WeatherMonitor weather_monitor = WeatherMonitor::Read;
  bool apply_transformation = false;
  bool apply_station_orientation = false;
  bool keep_last_position = true;
  bool send_unsolicited_messages = true;
  bool send_reflector_position = false;
  bool try_mode = false;
  bool has_nivel = false;
  bool has_video_camera = false;
};

struct SetUnits {
  static constexpr Command kCommand = Command::SetUnits;
  Units units;
};
struct SetStationOrientation {
  static constexpr Command kCommand = Command::SetStationOrientation;
  std::array<double, 3> translation{};
  std::array<double, 3> rotation{};
};
struct SetTransformation {
  static constexpr Command kCommand = Command::SetTransformation;
  std::array<double, 3> translation{};
  std::array<double, 3> rotation{};
  double scale = 1.0;
};
struct SetEnvironmentParams {
  static constexpr Command kCommand = Command::SetEnvironmentParams;
  Environment environment;
};
struct SetRefractionParams {
  static constexpr Command kCommand = Command::SetRefractionParams;
  Refraction refraction;
};
struct SetMeasurementMode {
  static constexpr Command kCommand = Command::SetMeasurementMode;
  MeasurementMode mode = MeasurementMode::ContinuousTime;
};
struct SetCoordinateSystemType {
  static constexpr Command kCommand = Command::SetCoordinateSystemType;
  CoordinateSystem type = CoordinateSystem::RightHanded;
};
struct SetStationaryModeParams {
  static constexpr Command kCommand = Command::SetStationaryModeParams;
  std::int32_t measurement_time_ms = 500;
  bool use_adm = false;
};
struct SetContinuousTimeModeParams {
  static constexpr Command kCommand = Command::SetContinuousTimeModeParams;
  std::int32_t time_separation_ms = 2;
  std::int32_t number_of_points = 0;  ///< 0: until StopMeasurement
  bool use_region = false;
  RegionType region_type = RegionType::Sphere;
};
struct SetContinuousDistanceModeParams {
  static constexpr Command kCommand = Command::SetContinuousDistanceModeParams;
  double spatial_distance = 1.0;
  std::int32_t number_of_points = 0;
  bool use_region = false;
  RegionType region_type = RegionType::Sphere;
};
struct SetReflector {
  static constexpr Command kCommand = Command::SetReflector;
  std::int32_t internal_id = 0;
};
struct SetSearchParams {
  static constexpr Command kCommand = Command::SetSearchParams;
  double radius = 50.0;
  std::int32_t timeout_ms = 10'000;
};
struct SetSystemSettings {
  static constexpr Command kCommand = Command::SetSystemSettings;
  SystemSettings settings;
};
struct GoPosition {
  static constexpr Command kCommand = Command::GoPosition;
  std::array<double, 3> position{};
  bool use_adm = false;
};
struct FindReflector {
  static constexpr Command kCommand = Command::FindReflector;
  double approximate_distance = 1000.0;
};
struct SetStatisticMode {
  static constexpr Command kCommand = Command::SetStatisticMode;
  StatisticMode stationary = StatisticMode::Standard;
  StatisticMode continuous = StatisticMode::Standard;
};
struct SetTriggerSource {
  static constexpr Command kCommand = Command::SetTriggerSource;
  TriggerSource source = TriggerSource::Internal;
};
struct SetExternTriggerParams {
  static constexpr Command kCommand = Command::SetExternTriggerParams;
  ClockTransition clock_transition = ClockTransition::Positive;
  ExternTriggerMode mode = ExternTriggerMode::Event;
  StartSignal start_signal = StartSignal::High;
  std::int32_t minimal_time_delay = 0;  ///< unit: not given by any public source
};
struct SetLongSystemParameter {
  static constexpr Command kCommand = Command::SetLongSystemParameter;
  LongParameter parameter = LongParameter::TcpDataPacketRate;
  std::int32_t value = 0;
};
struct GetLongSystemParameter {
  static constexpr Command kCommand = Command::GetLongSystemParameter;
  LongParameter parameter = LongParameter::TcpDataPacketRate;
};

using Request = std::variant<
    GetSystemStatus, GetTrackerStatus, SetUnits, GetUnits, Initialize, SetStationOrientation,
    SetTransformation, SetEnvironmentParams, GetEnvironmentParams, SetRefractionParams,
    GetRefractionParams, SetMeasurementMode, SetCoordinateSystemType, SetStationaryModeParams,
    SetContinuousTimeModeParams, SetContinuousDistanceModeParams, GetStationOrientation,
    GetTransformation, GetMeasurementMode, GetCoordinateSystemType, GetStationaryModeParams,
    GetContinuousTimeModeParams, GetContinuousDistanceModeParams, GetSearchParams, GetStatisticMode,
    SetReflector, GetReflector, GetReflectors, SetSearchParams, SetSystemSettings,
    GetSystemSettings, StartMeasurement, StopMeasurement, GoBirdBath, GoPosition, FindReflector,
    SetStatisticMode, SetTriggerSource, SetExternTriggerParams, SetLongSystemParameter,
    GetLongSystemParameter, GetMeasurementStatusInfo, GetObjectTemperature, GetTriggerBoardInfo,
    GetTrackerInfo>;

inline constexpr std::size_t kMaxRequestSize = 68;

[[nodiscard]] Command command_of(const Request&) ABBE_RT;

/// Writes a request to `out` and returns its number of bytes, 0 if `out` is too small;
/// kMaxRequestSize is always sufficient.
[[nodiscard]] std::size_t encode(const Request&, std::span<std::byte> out) ABBE_RT;

/// `packet` is one complete packet from the framer. Its size must be exactly that of the layout.
[[nodiscard]] tl::expected<Request, DecodeError> decode_request(
    std::span<const std::byte> packet) ABBE_RT;

}  // namespace abbe::protocol::emscon
