#pragma once
/// One of every emScon packet, with no two fields alike, for tests that run over all of them.

#include <algorithm>
#include <string>
#include <vector>

#include "abbe/protocol/emscon/results.hpp"

namespace abbe::protocol::emscon::samples {

using Bytes = std::vector<std::byte>;

template <class... Arguments>
Bytes encoded(const Arguments&... arguments) {
  Bytes bytes(kMaxPacketSize);
  bytes.resize(encode(arguments..., std::span<std::byte>{bytes}));
  return bytes;
}

inline Bytes from_hex(std::string_view hex) {
  std::string digits;
  std::copy_if(hex.begin(), hex.end(), std::back_inserter(digits), [](char c) { return c != ' '; });
  Bytes bytes;
  for (std::size_t i = 0; i + 1 < digits.size(); i += 2) {
    bytes.push_back(static_cast<std::byte>(std::stoi(digits.substr(i, 2), nullptr, 16)));
  }
  return bytes;
}

inline Name name(std::u16string_view text) {
  Name out{};
  std::copy(text.begin(), text.end(), out.begin());
  return out;
}

inline std::vector<Request> requests() {
  return {
      GetSystemStatus{},
      GetTrackerStatus{},
      SetUnits{{LengthUnit::Inch, AngleUnit::Gon, TemperatureUnit::Fahrenheit,
                PressureUnit::Kilopascal, HumidityUnit::RelativePercent}},
      GetUnits{},
      Initialize{},
      SetStationOrientation{{1, 2, 3}, {4, 5, 6}},
      SetTransformation{{1, 2, 3}, {4, 5, 6}, 7},
      SetEnvironmentParams{{21.5, 990.25, 40.75}},
      GetEnvironmentParams{},
      SetRefractionParams{{1.000271, 1.000281}},
      GetRefractionParams{},
      SetMeasurementMode{MeasurementMode::SphereCentre},
      SetCoordinateSystemType{CoordinateSystem::SphericalCounterClockwise},
      SetStationaryModeParams{750, true},
      SetContinuousTimeModeParams{2, 1000, true, RegionType::Box},
      SetContinuousDistanceModeParams{0.5, 100, true, RegionType::Box},
      SetReflector{7},
      GetReflector{},
      GetReflectors{},
      SetSearchParams{25.5, 9000},
      SetSystemSettings{
          {WeatherMonitor::ReadAndCompute, true, false, true, false, true, false, true, true}},
      GetSystemSettings{},
      StartMeasurement{},
      StopMeasurement{},
      GoBirdBath{},
      GoPosition{{100, 200, 300}, true},
      FindReflector{1234.5},
      SetStatisticMode{StatisticMode::Standard, StatisticMode::Extended},
      SetTriggerSource{TriggerSource::External},
      SetExternTriggerParams{ClockTransition::Negative, ExternTriggerMode::InternalClock,
                             StartSignal::High, 12},
      SetLongSystemParameter{LongParameter::TcpDataPacketRate, 10},
      GetLongSystemParameter{LongParameter::BeamCatch},
      GetMeasurementStatusInfo{},
      GetObjectTemperature{},
      GetTriggerBoardInfo{},
      GetTrackerInfo{},
      GetStationOrientation{},
      GetTransformation{},
      GetMeasurementMode{},
      GetCoordinateSystemType{},
      GetStationaryModeParams{},
      GetContinuousTimeModeParams{},
      GetContinuousDistanceModeParams{},
      GetSearchParams{},
      GetStatisticMode{},
  };
}

inline std::vector<Answer> answers() {
  TrackerInfoAnswer info{Status::Ok, 5, name(u"AT901-MR"), 4711, {}, 3000, {}};
  info.other[3] = std::byte{0x5a};
  info.more[31] = std::byte{0xa5};

  return {
      Acknowledge{Command::Initialize, Status::Ok},
      Acknowledge{Command::GetSystemStatus, Status::NoTrackerConnected},
      SystemStatusAnswer{Status::Ok, Status::NotWarmedUp, TrackerProcessorStatus::Booted,
                         LaserStatus::Heating, AdmStatus::Busy, 3, 6, 428, WeatherMonitor::Read, 17,
                         2042},
      TrackerStatusAnswer{Status::Ok, TrackerStatus::Ready},
      UnitsAnswer{Status::Ok, {LengthUnit::Metre, AngleUnit::Degree}},
      EnvironmentAnswer{Status::Ok, {19.5, 1001.5, 33.25}},
      RefractionAnswer{Status::Ok, {1.000271, 1.000281}},
      ReflectorAnswer{Status::Ok, 3},
      ReflectorsAnswer{Status::Ok, 2, 1, TargetType::CatEye, 0.125, name(u"RRR 1.5\"")},
      SystemSettingsAnswer{Status::Ok,
                           {WeatherMonitor::None, true, true, false, true, false, true}},
      LongSystemParameterAnswer{Status::Ok, LongParameter::Max6DRate, 100},
      MeasurementStatusInfoAnswer{Status::Ok, Status::NoDistanceSet, 2048 + 4096},
      ObjectTemperatureAnswer{Status::Ok, 20.25},
      TriggerBoardInfoAnswer{Status::Ok, 1, 23, 3000, 4},
      info,
      StationOrientationAnswer{Status::Ok, {{1, 2, 3}, {4, 5, 6}}},
      TransformationAnswer{Status::Ok, {{1, 2, 3}, {4, 5, 6}, 7}},
      MeasurementModeAnswer{Status::Ok, {MeasurementMode::SphereCentre}},
      CoordinateSystemTypeAnswer{Status::Ok, {CoordinateSystem::SphericalClockwise}},
      StationaryModeParamsAnswer{Status::Ok, {750, true}},
      ContinuousTimeModeParamsAnswer{Status::Ok, {5, 100, true, RegionType::Box}},
      ContinuousDistanceModeParamsAnswer{Status::Ok, {0.5, 100, true, RegionType::Box}},
      SearchParamsAnswer{Status::Ok, {25.5, 9000}},
      StatisticModeAnswer{Status::Ok, {StatisticMode::Extended, StatisticMode::Standard}},
  };
}

inline std::vector<MultiPoint> points() {
  return {{PointStatus::Ok, {12345, 678000}, {1000, 2000, -300}},
          {PointStatus::SpeedWarning, {12345, 680000}, {1001, 2001, -301}},
          {PointStatus::PrismError, {-1, 1}, {0.1, -0.2, 1e300}}};
}

inline std::vector<ExtendedMultiPoint> extended_points() {
  return {{points()[0], {{0.01, 0.02, 0.03}, 0.04, {0.05, 0.06, 0.07}}},
          {points()[1], {{0.11, 0.12, 0.13}, 0.14, {0.15, 0.16, 0.17}}}};
}

inline MultiHead head() {
  return {Status::Ok, MeasurementMode::ContinuousDistance, true, {21, 1000, 45}};
}

inline SingleResult single() {
  return {Status::Ok, MeasurementMode::Stationary,
          true,       {1, 2, 3},
          {4, 5, 6},  7,
          {8, 9, 10}, {11, 12, 13},
          14,         {15, 16, 17}};
}

/// Every packet of a controller, encoded.
inline std::vector<Bytes> controller_packets() {
  std::vector<Bytes> all;
  for (const Answer& a : answers()) all.push_back(encoded(a));
  all.push_back(encoded(ErrorResponse{Command::StartMeasurement, Status::Unknown}));
  all.push_back(encoded(StatusChange{Event::MeasurementReady}));
  all.push_back(encoded(single()));
  all.push_back(encoded(ReflectorPosition{Status::Ok, {1, 2, 3}}));
  all.push_back(encoded(head(), std::span<const MultiPoint>{points()}));
  all.push_back(encoded(head(), std::span<const ExtendedMultiPoint>{extended_points()}));
  all.push_back(from_hex("10000000 06000000 00000000 00000000"));
  return all;
}

/// Encodes again what decode() gave; empty for packets that have no encoder.
inline Bytes encoded_again(const ControllerPacket& packet) {
  return std::visit(
      []<class P>(const P& p) -> Bytes {
        if constexpr (std::is_same_v<P, OtherPacket>) {
          return {};
        } else if constexpr (std::is_same_v<P, MultiResult>) {
          std::vector<ExtendedMultiPoint> extended;
          std::vector<MultiPoint> plain;
          for (std::size_t k = 0; k < p.size(); ++k) {
            plain.push_back(p.point(k));
            if (p.extended()) extended.push_back({p.point(k), p.statistics(k)});
          }
          return p.extended() ? encoded(p.head(), std::span<const ExtendedMultiPoint>{extended})
                              : encoded(p.head(), std::span<const MultiPoint>{plain});
        } else {
          return encoded(p);
        }
      },
      packet);
}

}  // namespace abbe::protocol::emscon::samples
