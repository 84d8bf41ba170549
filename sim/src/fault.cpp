#include "abbe/sim/fault.hpp"

#include <array>
#include <span>

namespace abbe::sim {
namespace {

struct Name {
  std::string_view name;
  FaultKind kind;
};

constexpr std::array kTrackerFaults{
    Name{"beam_break", FaultKind::BeamBreak},
    Name{"speed_exceeded", FaultKind::SpeedExceeded},
    Name{"prism_error", FaultKind::PrismError},
    Name{"stall", FaultKind::Stall},
    Name{"mute", FaultKind::Mute},
    Name{"reboot", FaultKind::Reboot},
    Name{"disconnect", FaultKind::Disconnect},
    Name{"busy", FaultKind::Busy},
    Name{"weather", FaultKind::Weather},
    Name{"garbage", FaultKind::TrackerGarbage},
    Name{"reflector_away", FaultKind::ReflectorAway},
};
constexpr std::array kEncoderFaults{
    Name{"mute", FaultKind::Mute},          Name{"late", FaultKind::Late},
    Name{"restart", FaultKind::Restart},    Name{"emergency", FaultKind::Emergency},
    Name{"garbage", FaultKind::BusGarbage}, Name{"bus_off", FaultKind::BusOff},
    Name{"bundled", FaultKind::Bundled},    Name{"overflow", FaultKind::Overflow},
};
constexpr std::array kEnvironmentFaults{
    Name{"mute", FaultKind::Mute},
    Name{"late", FaultKind::Late},
    Name{"disconnect", FaultKind::Disconnect},
    Name{"exception", FaultKind::ModbusException},
    Name{"garbage", FaultKind::ModbusGarbage},
    Name{"wrong_map", FaultKind::WrongMap},
    Name{"sensors_gone", FaultKind::SensorsGone},
    Name{"sensor_value", FaultKind::SensorValue},
    Name{"sensor_stuck", FaultKind::SensorStuck},
    Name{"sensor_swapped", FaultKind::SensorSwapped},
    Name{"sensor_fahrenheit", FaultKind::SensorFahrenheit},
    Name{"sensor_byte_order", FaultKind::SensorByteOrder},
    Name{"sensor_spikes", FaultKind::SensorSpikes},
    Name{"sensor_drift", FaultKind::SensorDrift},
    Name{"sensor_other_slave", FaultKind::SensorOtherSlave},
};

constexpr std::array kCounterCardFaults{
    Name{"mute", FaultKind::Mute},
    Name{"stall", FaultKind::Stall},
    Name{"unplug", FaultKind::Unplug},
    Name{"restart", FaultKind::CardRestart},
    Name{"overrun", FaultKind::Overrun},
    Name{"lost_scans", FaultKind::LostScans},
    Name{"clock_jump", FaultKind::ClockJump},
    Name{"garbage", FaultKind::UsbGarbage},
    Name{"fail_request", FaultKind::FailRequest},
    Name{"disconnect", FaultKind::Disconnect},
};

constexpr std::array kMeasuringMachineFaults{
    Name{"mute", FaultKind::Mute},
    Name{"disconnect", FaultKind::Disconnect},
    Name{"emergency_stop", FaultKind::EmergencyStop},
    Name{"error", FaultKind::ErrorReport},
    Name{"odd_tag", FaultKind::OddTag},
    Name{"not_ascii", FaultKind::NotAscii},
    Name{"refuse_touch", FaultKind::RefuseTouch},
    Name{"refuse_way", FaultKind::RefuseWay},
    Name{"garbage", FaultKind::LineGarbage},
};

constexpr std::array kAxisLinesFaults{
    Name{"invalid", FaultKind::PrismError},
    Name{"stall", FaultKind::Stall},
    Name{"mute", FaultKind::Mute},
    Name{"disconnect", FaultKind::Disconnect},
    Name{"garbage", FaultKind::TrackerGarbage},
};

std::span<const Name> names_for(FaultTarget target) {
  switch (target) {
    case FaultTarget::Tracker:
      return kTrackerFaults;
    case FaultTarget::Encoder:
      return kEncoderFaults;
    case FaultTarget::Environment:
      return kEnvironmentFaults;
    case FaultTarget::CounterCard:
      return kCounterCardFaults;
    case FaultTarget::MeasuringMachine:
      return kMeasuringMachineFaults;
    case FaultTarget::AxisLines:
      return kAxisLinesFaults;
  }

  return {};
}

}  // namespace

std::optional<FaultKind> fault_kind(FaultTarget target, std::string_view name) {
  for (const Name& candidate : names_for(target)) {
    if (candidate.name == name) return candidate.kind;
  }
  return std::nullopt;
}

}  // namespace abbe::sim
