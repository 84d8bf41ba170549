#pragma once
/// Misbehaviour on a timetable: what goes wrong, when (simulated seconds after the machine begins
/// to move), how long.

#include <cstdint>
#include <optional>
#include <string_view>

namespace abbe::sim {

enum class FaultKind {
  // tracker
  BeamBreak,       ///< error packet and event NotReady, no points; after `duration_s` event Ready
  SpeedExceeded,   ///< points say so, whatever the speed
  PrismError,      ///< points say so
  Stall,           ///< the socket is silent, then everything comes at once
  Mute,            ///< tracker: commands and points are swallowed; encoder: the node says nothing
  Reboot,          ///< server closing, connection lost, warm again after `duration_s`
  Disconnect,      ///< the connection breaks and can be made again at once
  Busy,            ///< commands are answered with ServerBusy
  Weather,         ///< the air becomes `value` K warmer at once, with its events
  TrackerGarbage,  ///< bytes that are no packet
  ReflectorAway,   ///< bird bath and search find none
  // encoder
  Late,        ///< frames leave `value` s late
  Restart,     ///< the node boots anew
  Emergency,   ///< EMCY with code `value`; after `duration_s` the all-clear
  BusGarbage,  ///< datagrams that are no CAN frames
  Bundled,     ///< frames are held back and leave together every `value` s, as a tunnel does
  Overflow,    ///< error frame: the controller had no room for what it received
  BusOff,      ///< error frame bus-off, silence, then the error frame restarted
  // environment (and Mute, Late, Disconnect: port or terminal gone for `duration_s`)
  ModbusException,  ///< every request is answered with exception `value` (0: 6, busy)
  ModbusGarbage,    ///< bytes instead of answers
  WrongMap,         ///< every register lies one address higher
  SensorsGone,      ///< the probe is unplugged, the wires are broken
  // counter card; it also stalls and is mute
  Unplug,       ///< gone from the bus, there again after `duration_s` with all counters at zero
  CardRestart,  ///< power off and on
  Overrun,      ///< the FIFO was full: no more scans until it is reset
  LostScans,    ///< the next `value` scans are never seen
  ClockJump,    ///< the counted clock jumps by `value` counts
  UsbGarbage,   ///< bytes that are no USB/IP
  FailRequest,  ///< the next `value` control transfers fail (0: one)
  // measuring machine; it also is mute and disconnects
  EmergencyStop,  ///< somebody pressed it; pulled out again after `duration_s`
  ErrorReport,    ///< an error of severity `value` that is of no command
  OddTag,         ///< an answer to a command that was not sent
  NotAscii,       ///< a warning with letters that are not ASCII
  RefuseTouch,    ///< the next touch ends with error `value` (0: 1006, surface not found)
  RefuseWay,      ///< the next GoTo does (0: 2500, out of limits)
  LineGarbage,    ///< bytes that are no lines
};

struct Fault {
  FaultKind kind = FaultKind::BeamBreak;
  double at_s = 0.0;
  double duration_s = 1.0;
  double value = 0.0;
  /// encoder faults: CANopen node; environment faults: number of the device; 0 = all
  std::uint8_t node = 0;
};

enum class FaultTarget { Tracker, Encoder, Environment, CounterCard, MeasuringMachine };

struct ScheduledFault {
  FaultTarget target = FaultTarget::Tracker;
  Fault fault;
};

/// The kind by its name in a configuration ("beam_break", "late", ...), for this device only.
[[nodiscard]] std::optional<FaultKind> fault_kind(FaultTarget target, std::string_view name);

}  // namespace abbe::sim
