#pragma once
/// Faults to inject: the kind, the time (simulated seconds after the machine begins to move) and
/// the duration.

#include <cstdint>
#include <optional>
#include <string_view>

namespace abbe::sim {

enum class FaultKind {
  // faults of a tracker
  BeamBreak,       ///< error packet and event NotReady, no points; after `duration_s` event Ready
  SpeedExceeded,   ///< points have this status at any speed
  PrismError,      ///< points have this status; lines: an invalid status
  Stall,           ///< nothing is sent; afterwards everything is sent at once
  Mute,            ///< tracker: commands and points are discarded; encoder: the node sends nothing
  Reboot,          ///< event ServerClosing, connection lost; restarted after `duration_s`
  Disconnect,      ///< the connection breaks; a new one is accepted at once
  Busy,            ///< commands are answered with ServerBusy
  Weather,         ///< the air temperature rises by `value` K at once, with its events
  TrackerGarbage,  ///< bytes that are not a packet
  ReflectorAway,   ///< GoBirdBath and FindReflector find no reflector
  // faults of an encoder
  Late,        ///< frames are sent `value` s late
  Restart,     ///< the node boots again
  Emergency,   ///< EMCY with code `value`; after `duration_s` EMCY "no error"
  BusGarbage,  ///< datagrams that are not CAN frames
  Bundled,     ///< frames are held back and sent together every `value` s, as by a tunnel
  Overflow,    ///< error frame: receive overflow of the CAN controller
  BusOff,      ///< error frame bus-off, silence, then the error frame restarted
  // Faults of environment devices; Mute, Late and Disconnect (port or terminal closed for
  // `duration_s`) also exist for them.
  ModbusException,  ///< every request is answered with exception `value` (0: 6, busy)
  ModbusGarbage,    ///< bytes instead of answers
  WrongMap,         ///< every register is one address higher
  SensorsGone,      ///< the probe is unplugged, the sensor wires are broken
  // Faults of one temperature input (`input`, 0: all) of an environment device; see BrokenInput.
  SensorValue,       ///< reads `value` C: a power-on value, a short circuit
  SensorStuck,       ///< keeps its reading
  SensorSwapped,     ///< reads the sensor of the other input of its pair (1 and 2, 3 and 4, ...)
  SensorFahrenheit,  ///< reads degrees Fahrenheit
  SensorByteOrder,   ///< the bytes of its register are exchanged
  SensorSpikes,      ///< every fifth second the reading is `value` K higher
  SensorDrift,       ///< drifts by `value` K per hour
  SensorOtherSlave,  ///< reads the values of another module: the input four places further
  // Faults of counter cards; Mute, Stall and Disconnect also exist for them.
  Unplug,       ///< removed from the bus; back after `duration_s` with all counters at zero
  CardRestart,  ///< power off and on
  Overrun,      ///< the FIFO is full: no more scans until it is reset
  LostScans,    ///< the next `value` scans are not made
  ClockJump,    ///< the counted clock jumps by `value` counts
  UsbGarbage,   ///< bytes that are not USB/IP
  FailRequest,  ///< the next `value` control transfers fail (0: one)
  // Faults of measuring machines; Mute and Disconnect also exist for them.
  EmergencyStop,  ///< the button is pressed; it is released after `duration_s`
  ErrorReport,    ///< an error of severity `value` that belongs to no command
  OddTag,         ///< an answer with the tag of a command that was not sent
  NotAscii,       ///< a warning with characters that are not ASCII
  RefuseTouch,    ///< the next touch ends with error `value` (0: 1006, surface not found)
  RefuseWay,      ///< the next GoTo ends with error `value` (0: 2500, out of limits)
  LineGarbage,    ///< bytes that are not a line of the protocol
};

struct Fault {
  FaultKind kind = FaultKind::BeamBreak;
  double at_s = 0.0;
  double duration_s = 1.0;
  double value = 0.0;
  /// encoder faults: CANopen node; environment faults: number of the device; 0 = all
  std::uint8_t node = 0;
  std::uint8_t input = 0;  ///< input of an environment device, counted from 1; 0 = all
};

enum class FaultTarget { Tracker, Encoder, Environment, CounterCard, MeasuringMachine, AxisLines };

struct ScheduledFault {
  FaultTarget target = FaultTarget::Tracker;
  Fault fault;
};

/// The kind with this name in a configuration ("beam_break", "late", ...), among the kinds of
/// `target`.
[[nodiscard]] std::optional<FaultKind> fault_kind(FaultTarget target, std::string_view name);

}  // namespace abbe::sim
