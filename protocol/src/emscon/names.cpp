#include "abbe/protocol/emscon/types.hpp"

namespace abbe::protocol::emscon {

const char* name_of(Status s) ABBE_RT {
  switch (s) {
    case Status::Ok:
      return "ok";
    case Status::ServerBusy:
      return "server busy";
    case Status::NotImplemented:
      return "not implemented";
    case Status::WrongParameter:
    case Status::WrongParameter1:
      return "wrong parameter";
    case Status::Parameter1OutOfRangeOk:
      return "parameter out of range, accepted";
    case Status::Parameter1OutOfRangeNok:
      return "parameter out of range, refused";
    case Status::WrongCurrentReflector:
      return "wrong current reflector";
    case Status::NoTrackerProcessorFound:
      return "no tracker processor found";
    case Status::NoWeatherMonitor:
      return "no weather monitor";
    case Status::NoAdm:
      return "no distance meter (ADM)";
    case Status::UsageConflict:
      return "usage conflict";
    case Status::Unknown:
      return "unknown cause";
    case Status::NoDistanceSet:
      return "no distance set";
    case Status::NoTrackerConnected:
      return "no tracker connected";
    case Status::TrackerNotInitialized:
      return "tracker not initialised";
    case Status::ExternalControl:
      return "under control of another client";
    case Status::MeteoDataOutOfRange:
      return "weather data out of range";
    case Status::InternalProcessActive:
      return "internal process active";
    case Status::NoTemperature:
      return "no temperature from the weather station";
    case Status::NoPressure:
      return "no pressure from the weather station";
    case Status::NoHumidity:
      return "no humidity from the weather station";
    case Status::NoValidAdmCompensation:
      return "no valid compensation of the distance meter (ADM)";
    case Status::MeasurementNotReady:
      return "not ready to measure";
    case Status::AdmStartUpBusy:
      return "distance meter (ADM) starting up";
    case Status::NoStationaryResult:
      return "no stationary result";
    case Status::MultipleConnectionsNotAllowed:
      return "another client is connected";
    case Status::NotWarmedUp:
      return "not warmed up";
    case Status::SystemNotReady:
      return "system not ready";
    case Status::SensorCommunicationFailed:
      return "communication with the sensor failed";
  }
  return "status";
}

const char* name_of(Command c) ABBE_RT {
  switch (c) {
    case Command::GetSystemStatus:
      return "GetSystemStatus";
    case Command::GetTrackerStatus:
      return "GetTrackerStatus";
    case Command::SetUnits:
      return "SetUnits";
    case Command::GetUnits:
      return "GetUnits";
    case Command::Initialize:
      return "Initialize";
    case Command::SetStationOrientation:
      return "SetStationOrientation";
    case Command::GetStationOrientation:
      return "GetStationOrientation";
    case Command::SetTransformation:
      return "SetTransformation";
    case Command::GetTransformation:
      return "GetTransformation";
    case Command::SetEnvironmentParams:
      return "SetEnvironmentParams";
    case Command::GetEnvironmentParams:
      return "GetEnvironmentParams";
    case Command::SetRefractionParams:
      return "SetRefractionParams";
    case Command::GetRefractionParams:
      return "GetRefractionParams";
    case Command::SetMeasurementMode:
      return "SetMeasurementMode";
    case Command::GetMeasurementMode:
      return "GetMeasurementMode";
    case Command::SetCoordinateSystemType:
      return "SetCoordinateSystemType";
    case Command::GetCoordinateSystemType:
      return "GetCoordinateSystemType";
    case Command::SetStationaryModeParams:
      return "SetStationaryModeParams";
    case Command::GetStationaryModeParams:
      return "GetStationaryModeParams";
    case Command::SetContinuousTimeModeParams:
      return "SetContinuousTimeModeParams";
    case Command::GetContinuousTimeModeParams:
      return "GetContinuousTimeModeParams";
    case Command::SetContinuousDistanceModeParams:
      return "SetContinuousDistanceModeParams";
    case Command::GetContinuousDistanceModeParams:
      return "GetContinuousDistanceModeParams";
    case Command::SetReflector:
      return "SetReflector";
    case Command::GetReflector:
      return "GetReflector";
    case Command::GetReflectors:
      return "GetReflectors";
    case Command::SetSearchParams:
      return "SetSearchParams";
    case Command::GetSearchParams:
      return "GetSearchParams";
    case Command::SetSystemSettings:
      return "SetSystemSettings";
    case Command::GetSystemSettings:
      return "GetSystemSettings";
    case Command::StartMeasurement:
      return "StartMeasurement";
    case Command::StopMeasurement:
      return "StopMeasurement";
    case Command::GoBirdBath:
      return "GoBirdBath";
    case Command::GoPosition:
      return "GoPosition";
    case Command::FindReflector:
      return "FindReflector";
    case Command::SetStatisticMode:
      return "SetStatisticMode";
    case Command::GetStatisticMode:
      return "GetStatisticMode";
    case Command::SetTriggerSource:
      return "SetTriggerSource";
    case Command::SetExternTriggerParams:
      return "SetExternTriggerParams";
    case Command::SetLongSystemParameter:
      return "SetLongSystemParameter";
    case Command::GetLongSystemParameter:
      return "GetLongSystemParameter";
    case Command::GetMeasurementStatusInfo:
      return "GetMeasurementStatusInfo";
    case Command::GetObjectTemperature:
      return "GetObjectTemperature";
    case Command::GetTriggerBoardInfo:
      return "GetTriggerBoardInfo";
    case Command::GetTrackerInfo:
      return "GetTrackerInfo";
  }
  return "command";
}

const char* name_of(DecodeError e) ABBE_RT {
  switch (e) {
    case DecodeError::Truncated:
      return "truncated packet";
    case DecodeError::SizeMismatch:
      return "packet of the wrong size";
    case DecodeError::NotACommand:
      return "not a command";
    case DecodeError::UnknownCommand:
      return "unknown command";
    case DecodeError::UnknownType:
      return "unknown packet type";
    case DecodeError::CountMismatch:
      return "number of points does not fit the packet";
  }
  return "decode error";
}

}  // namespace abbe::protocol::emscon
