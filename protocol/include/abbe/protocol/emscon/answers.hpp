#pragma once
/// Answers of an emScon controller (packet type 0, controller to client): one answer per request,
/// with the command number of the request. GetReflectors gets one answer per reflector. Units as in
/// requests.hpp. Pure, allocation-free, accepts any bytes.

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <tl/expected.hpp>
#include <variant>

#include "abbe/protocol/emscon/requests.hpp"
#include "abbe/protocol/emscon/types.hpp"

namespace abbe::protocol::emscon {

using Name = std::array<char16_t, 32>;  ///< UTF-16, ends at the first zero

/// The answer to a command whose only result is its status, and to any refused command.
struct Acknowledge {
  Command command{};
  Status status = Status::Ok;
};

struct SystemStatusAnswer {
  static constexpr Command kCommand = Command::GetSystemStatus;
  Status status = Status::Ok;
  Status last_result = Status::Ok;
  TrackerProcessorStatus tracker_processor = TrackerProcessorStatus::Initialised;
  LaserStatus laser = LaserStatus::Ready;
  AdmStatus adm = AdmStatus::Ready;
  std::int32_t version_major = 0;
  std::int32_t version_minor = 0;
  std::int32_t version_build = 0;
  WeatherMonitor weather_monitor = WeatherMonitor::None;
  std::int32_t flags = 0;
  std::int32_t serial_number = 0;
};
struct TrackerStatusAnswer {
  static constexpr Command kCommand = Command::GetTrackerStatus;
  Status status = Status::Ok;
  TrackerStatus tracker = TrackerStatus::NotReady;
};
struct UnitsAnswer {
  static constexpr Command kCommand = Command::GetUnits;
  Status status = Status::Ok;
  Units units;
};
struct EnvironmentAnswer {
  static constexpr Command kCommand = Command::GetEnvironmentParams;
  Status status = Status::Ok;
  Environment environment;
};
struct RefractionAnswer {
  static constexpr Command kCommand = Command::GetRefractionParams;
  Status status = Status::Ok;
  Refraction refraction;
};
struct ReflectorAnswer {
  static constexpr Command kCommand = Command::GetReflector;
  Status status = Status::Ok;
  std::int32_t internal_id = 0;
};
struct ReflectorsAnswer {
  static constexpr Command kCommand = Command::GetReflectors;
  Status status = Status::Ok;
  std::int32_t total = 0;  ///< total number of these answers
  std::int32_t internal_id = 0;
  TargetType target_type = TargetType::CornerCube;
  double surface_offset = 0.0;
  Name name{};
};
struct SystemSettingsAnswer {
  static constexpr Command kCommand = Command::GetSystemSettings;
  Status status = Status::Ok;
  SystemSettings settings;
};
struct LongSystemParameterAnswer {
  static constexpr Command kCommand = Command::GetLongSystemParameter;
  Status status = Status::Ok;
  LongParameter parameter{};
  std::int32_t value = 0;
};
struct MeasurementStatusInfoAnswer {
  static constexpr Command kCommand = Command::GetMeasurementStatusInfo;
  Status status = Status::Ok;
  Status last_result = Status::Ok;
  std::int32_t bits = 0;  ///< MeasurementStatusBit
};
struct ObjectTemperatureAnswer {
  static constexpr Command kCommand = Command::GetObjectTemperature;
  Status status = Status::Ok;
  double temperature = 20.0;
};
struct TriggerBoardInfoAnswer {
  static constexpr Command kCommand = Command::GetTriggerBoardInfo;
  Status status = Status::Ok;
  std::int32_t card_type = 0;
  std::int32_t fpga_version = 0;
  std::int32_t max_trigger_frequency_hz = 0;
  std::int32_t error = 0;
};
/// An answer of 164 bytes. Only the named fields are used; `other` and `more` are raw bytes.
struct TrackerInfoAnswer {
  static constexpr Command kCommand = Command::GetTrackerInfo;
  Status status = Status::Ok;
  std::int32_t sensor_type = 0;
  Name name{};
  std::int32_t serial_number = 0;
  std::array<std::byte, 40> other{};
  std::int32_t max_data_rate_hz = 1000;  ///< points per second
  std::array<std::byte, 32> more{};
};

/// Answers that contain a setting in the layout of the request that sets it.
template <class Set, Command kId>
struct SettingAnswer {
  static constexpr Command kCommand = kId;
  Status status = Status::Ok;
  Set set;
};
using StationOrientationAnswer =
    SettingAnswer<SetStationOrientation, Command::GetStationOrientation>;
using TransformationAnswer = SettingAnswer<SetTransformation, Command::GetTransformation>;
using MeasurementModeAnswer = SettingAnswer<SetMeasurementMode, Command::GetMeasurementMode>;
using CoordinateSystemTypeAnswer =
    SettingAnswer<SetCoordinateSystemType, Command::GetCoordinateSystemType>;
using StationaryModeParamsAnswer =
    SettingAnswer<SetStationaryModeParams, Command::GetStationaryModeParams>;
using ContinuousTimeModeParamsAnswer =
    SettingAnswer<SetContinuousTimeModeParams, Command::GetContinuousTimeModeParams>;
using ContinuousDistanceModeParamsAnswer =
    SettingAnswer<SetContinuousDistanceModeParams, Command::GetContinuousDistanceModeParams>;
using SearchParamsAnswer = SettingAnswer<SetSearchParams, Command::GetSearchParams>;
using StatisticModeAnswer = SettingAnswer<SetStatisticMode, Command::GetStatisticMode>;

using Answer =
    std::variant<Acknowledge, SystemStatusAnswer, TrackerStatusAnswer, UnitsAnswer,
                 EnvironmentAnswer, RefractionAnswer, ReflectorAnswer, ReflectorsAnswer,
                 SystemSettingsAnswer, LongSystemParameterAnswer, MeasurementStatusInfoAnswer,
                 ObjectTemperatureAnswer, TriggerBoardInfoAnswer, TrackerInfoAnswer,
                 StationOrientationAnswer, TransformationAnswer, MeasurementModeAnswer,
                 CoordinateSystemTypeAnswer, StationaryModeParamsAnswer,
                 ContinuousTimeModeParamsAnswer, ContinuousDistanceModeParamsAnswer,
                 SearchParamsAnswer, StatisticModeAnswer>;

inline constexpr std::size_t kMaxAnswerSize = 164;

[[nodiscard]] Command command_of(const Answer&) ABBE_RT;
[[nodiscard]] Status status_of(const Answer&) ABBE_RT;

/// Writes an answer to `out` and returns its number of bytes, 0 if `out` is too small;
/// kMaxAnswerSize is always sufficient.
[[nodiscard]] std::size_t encode(const Answer&, std::span<std::byte> out) ABBE_RT;

/// `packet` is one complete packet. A packet of 16 bytes is an Acknowledge for every command (a
/// refused query has this form). A longer packet is the specific answer of its command. Additional
/// bytes at its end (from later firmware) are ignored.
[[nodiscard]] tl::expected<Answer, DecodeError> decode_answer(
    std::span<const std::byte> packet) ABBE_RT;

}  // namespace abbe::protocol::emscon
