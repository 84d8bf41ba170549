#pragma once
/// Constants of the Leica emScon TPI (the TCP interface of LTD and AT901 tracker controllers, and
/// in part of AT40x). Source: the numeric values of the emScon TPI 3.6 interface as used by public
/// clients. On the wire every enum is a little-endian int32; a value that is not listed here is
/// kept and not refused.

#include <chrono>
#include <cstddef>
#include <cstdint>

#include "abbe/protocol/rt.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::protocol::emscon {

inline constexpr std::uint16_t kPort = 700;
inline constexpr std::size_t kHeaderSize = 8;  ///< int32 size (of the whole packet), int32 type
/// Largest packet, which is the buffer size of public clients. A larger packet is refused.
inline constexpr std::size_t kMaxPacketSize = 65536;

enum class PacketType : std::int32_t {
  Command = 0,  ///< request or answer
  Error = 1,
  SingleResult = 2,
  MultiResult = 3,
  StationaryProbe = 4,
  ContinuousProbe = 5,
  Nivel = 6,
  ReflectorPosition = 7,
  StatusChange = 8,
  SingleResult2 = 9,
  MultiResult2 = 10,
  ProbePosition = 11,
};

enum class Command : std::int32_t {
  GetSystemStatus = 1,
  GetTrackerStatus = 2,
  SetUnits = 5,
  GetUnits = 6,
  Initialize = 7,
  SetStationOrientation = 12,
  GetStationOrientation = 13,
  SetTransformation = 14,
  GetTransformation = 15,
  SetEnvironmentParams = 20,
  GetEnvironmentParams = 21,
  SetRefractionParams = 22,
  GetRefractionParams = 23,
  SetMeasurementMode = 24,
  GetMeasurementMode = 25,
  SetCoordinateSystemType = 26,
  GetCoordinateSystemType = 27,
  SetStationaryModeParams = 28,
  GetStationaryModeParams = 29,
  SetContinuousTimeModeParams = 30,
  GetContinuousTimeModeParams = 31,
  SetContinuousDistanceModeParams = 32,
  GetContinuousDistanceModeParams = 33,
  SetReflector = 40,
  GetReflector = 41,
  GetReflectors = 42,
  SetSearchParams = 43,
  GetSearchParams = 44,
  SetSystemSettings = 47,
  GetSystemSettings = 48,
  StartMeasurement = 49,
  StopMeasurement = 52,
  GoBirdBath = 54,
  GoPosition = 55,
  FindReflector = 63,
  SetStatisticMode = 80,
  GetStatisticMode = 81,
  SetTriggerSource = 96,
  SetExternTriggerParams = 115,
  SetLongSystemParameter = 120,
  GetLongSystemParameter = 121,
  GetMeasurementStatusInfo = 122,
  GetObjectTemperature = 127,
  GetTriggerBoardInfo = 128,
  GetTrackerInfo = 132,
};

enum class Status : std::int32_t {
  Ok = 0,
  ServerBusy = 1,
  NotImplemented = 2,
  WrongParameter = 3,
  WrongParameter1 = 4,  ///< 5 to 10: parameters 2 to 7
  Parameter1OutOfRangeOk = 11,
  Parameter1OutOfRangeNok = 12,  ///< 13 to 22: parameters 2 to 6; odd values mean accepted
  WrongCurrentReflector = 23,
  NoTrackerProcessorFound = 26,
  NoWeatherMonitor = 27,
  NoAdm = 30,
  UsageConflict = 35,
  Unknown = 36,
  NoDistanceSet = 37,
  NoTrackerConnected = 38,
  TrackerNotInitialized = 39,
  ExternalControl = 46,
  MeteoDataOutOfRange = 57,
  InternalProcessActive = 59,
  NoTemperature = 94,
  NoPressure = 95,
  NoHumidity = 96,
  NoValidAdmCompensation = 10002,
  MeasurementNotReady = 10004,
  AdmStartUpBusy = 10005,
  NoStationaryResult = 10009,
  MultipleConnectionsNotAllowed = 10011,
  NotWarmedUp = 10012,
  SystemNotReady = 10014,
  SensorCommunicationFailed = 10015,
};

/// True if the command was carried out, also with a parameter out of range that was accepted.
[[nodiscard]] constexpr bool accepted(Status s) ABBE_RT {
  const auto value = static_cast<std::int32_t>(s);
  return value == 0 || (value >= 11 && value <= 22 && value % 2 == 1);
}

/// Text for messages; "status" or "command" for a number that is not listed here. Never null.
[[nodiscard]] const char* name_of(Status) ABBE_RT;
[[nodiscard]] const char* name_of(Command) ABBE_RT;

enum class Event : std::int32_t {
  DistanceSet = 0,
  LaserWarmedUp = 1,
  EnvironmentParamsChanged = 2,
  RefractionParamsChanged = 3,
  UnitsChanged = 6,
  ReflectorChanged = 7,
  MeasurementModeChanged = 17,
  MeasurementNotReady = 25,
  MeasurementBusy = 26,
  MeasurementReady = 27,
  MeasurementCountReached = 28,
  TriggerSourceChanged = 29,
  IsFace1 = 30,
  IsFace2 = 31,
  ExternalTrigger = 102,
  ExternalTriggerStart = 103,
  ExternalTriggerStop = 104,
  ObjectTemperatureChanged = 105,
  LaserReachingLimit = 145,
  LaserNotStabilized = 146,
  InitStatusChanged = 151,
  TrackerProcessorClosing = 997,
  ServerClosing = 998,
  ServerStarted = 999,
};

enum class LengthUnit : std::int32_t {
  Metre = 0,
  Millimetre = 1,
  Micrometre = 2,
  Foot = 3,
  Yard = 4,
  Inch = 5
};
enum class AngleUnit : std::int32_t { Radian = 0, Degree = 1, Gon = 2 };
enum class TemperatureUnit : std::int32_t { Celsius = 0, Fahrenheit = 1 };
enum class PressureUnit : std::int32_t {
  Millibar = 0,
  Hectopascal = 1,
  Kilopascal = 2,
  MillimetreOfMercury = 3,
  PoundPerSquareInch = 4,
  InchOfWater = 5,
  InchOfMercury = 6,
};
enum class HumidityUnit : std::int32_t { RelativePercent = 0 };

enum class TrackerStatus : std::int32_t { NotReady = 0, Busy = 1, Ready = 2, SixDInvalid = 3 };
enum class TrackerProcessorStatus : std::int32_t {
  NoneFound = 0,
  Found = 1,
  NotBooted = 2,
  Booted = 3,
  CompensationSet = 4,
  Initialised = 5,
};
enum class LaserStatus : std::int32_t {
  CommunicationFailed = 0,
  NotAvailable = 1,
  Heating = 2,
  Ready = 3,
  Unable = 4,
  Off = 5,
};
enum class AdmStatus : std::int32_t {
  None = 0,
  CommunicationFailed = 1,
  Ready = 2,
  Busy = 3,
  HardwareError = 4,
  Locked = 5,
  NotCompensated = 6,
};
enum class WeatherMonitor : std::int32_t { None = 0, Read = 1, ReadAndCompute = 2 };

enum class MeasurementMode : std::int32_t {
  Stationary = 0,
  ContinuousTime = 1,
  ContinuousDistance = 2,
  Grid = 3,
  SphereCentre = 4,
  CircleCentre = 5,  ///< 6 to 11: the same modes with a six-degree-of-freedom probe
};
/// Order and signs of the spherical values are not confirmed by any public source: use RightHanded.
enum class CoordinateSystem : std::int32_t {
  RightHanded = 0,
  LeftHandedX = 1,
  LeftHandedY = 2,
  LeftHandedZ = 3,
  CylindricalClockwise = 4,
  CylindricalCounterClockwise = 5,
  SphericalClockwise = 6,
  SphericalCounterClockwise = 7,
};
enum class PointStatus : std::int32_t {
  Ok = 0,
  SpeedWarning = 1,
  SpeedExceeded = 2,
  PrismError = 3,
  TriggerTimeViolation = 4,
};
enum class RegionType : std::int32_t { Sphere = 0, Box = 1 };
enum class TargetType : std::int32_t { CornerCube = 1, CatEye = 2, GlassPrism = 3, Rfi = 4 };
/// Standard: results are packets of type 2 and 3. Extended: of type 9 and 10.
enum class StatisticMode : std::int32_t { Standard = 0, Extended = 1 };
enum class TriggerSource : std::int32_t { Internal = 1, External = 2, ExternalEventMessage = 3 };
enum class ClockTransition : std::int32_t { Negative = 0, Positive = 1 };
enum class ExternTriggerMode : std::int32_t { Event = 0, ExternalClock = 1, InternalClock = 2 };
enum class StartSignal : std::int32_t { Low = 0, High = 1 };
enum class LongParameter : std::int32_t {
  KeepLastPosition = 0,
  WeatherMonitor = 1,
  BeamCatch = 3,
  CommandQueueSize = 200,
  Max6DRate = 300,
  TcpDataPacketRate = 400,  ///< 3 to 10 packets per second (LTD706 and later)
};
/// Bits of MeasurementStatusInfo::bits.
enum class MeasurementStatusBit : std::int32_t {
  Tracker = 1,
  Compensation = 2,
  Adm = 4,
  AdmCompensation = 8,
  ReflectorFound = 2048,
  Face1 = 4096,
  Initialised = 65536,
};

/// Reading of the tracker's own clock, contained in every point: seconds and microseconds since an
/// arbitrary epoch.
struct TrackerClockReading {
  std::int32_t seconds = 0;
  std::int32_t microseconds = 0;

  /// Any two numbers give an instant, also if they are not normalised.
  [[nodiscard]] constexpr DeviceTime to_device_time() const ABBE_RT {
    return DeviceTime{std::chrono::seconds{seconds} + std::chrono::microseconds{microseconds}};
  }
  /// Rounds down to the microsecond. Instants beyond +-2^31 s cannot be represented.
  [[nodiscard]] static constexpr TrackerClockReading from(DeviceTime t) ABBE_RT {
    const auto since_epoch = t.time_since_epoch();
    const auto whole = std::chrono::floor<std::chrono::seconds>(since_epoch);
    const auto rest = std::chrono::floor<std::chrono::microseconds>(since_epoch - whole);
    return {static_cast<std::int32_t>(whole.count()), static_cast<std::int32_t>(rest.count())};
  }
};

/// The reason why bytes are not a valid packet.
enum class DecodeError {
  Truncated = 1,   ///< fewer bytes than the header, the size field or the packet's layout requires
  SizeMismatch,    ///< the size field is not the number of bytes, or not the size of this packet
  NotACommand,     ///< to a controller: the type is not 0
  UnknownCommand,  ///< type 0 with a command that is not part of this interface
  UnknownType,     ///< from a controller: the type is not in 0 to 11
  CountMismatch,   ///< the number of points of a multi-result does not fit its size
};
[[nodiscard]] const char* name_of(DecodeError) ABBE_RT;

}  // namespace abbe::protocol::emscon
