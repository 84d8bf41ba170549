#pragma once
/// The raw bytes of a recording, device by device, as they crossed the wire: what a replay serves.
/// Reads the MCAP file whole or broken; only messages on abbe/v1/RawBytes are looked at. Pure but
/// for memory.

#include <chrono>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/sim/error.hpp"
#include "abbe/sim/sim_clock.hpp"

namespace abbe::sim {

struct RecordedBlock {
  HostTime time{};
  bool to_device = false;
  bool hole_before = false;      ///< the recording lost blocks before this one
  std::vector<std::byte> bytes;  ///< of one read or one write: continued blocks are joined

  /// Nothing from a device: a connection begins (with encoders: time has passed).
  [[nodiscard]] bool connects() const { return !to_device && bytes.empty(); }
  /// Nothing to a device: the connection was lost, and not by us.
  [[nodiscard]] bool lost() const { return to_device && bytes.empty(); }
};

enum class RecordedKind {
  Tracker,      ///< emScon packets
  Encoders,     ///< CAN frames in datagrams, whatever the bus was
  CounterCard,  ///< USB/IP messages, whatever the transport was
  ModbusTcp,
  ModbusRtu,
  MeasuringMachine,  ///< lines of I++ DME
};

struct RecordedDevice {
  std::string name;
  RecordedKind kind{};
  std::vector<RecordedBlock> blocks;
};

/// By what was said to the device, or, where nothing was, by what it said; a tracker, if that is no
/// protocol known here.
[[nodiscard]] RecordedKind kind_of(std::span<const RecordedBlock> blocks);

/// The text of the configuration a recording was made with; empty if it does not hold one.
[[nodiscard]] std::string recorded_configuration(std::span<const std::byte> file);

/// `name` stands in the errors. BadInput: no MCAP file, or one without raw bytes.
[[nodiscard]] Result<std::vector<RecordedDevice>> read_traffic(std::span<const std::byte> file,
                                                               std::string_view name);

/// A master that paused for longer is led back to where the recording is.
inline constexpr std::chrono::milliseconds kOutOfStep{50};

/// Recorded time -> time of the replay, shared by all devices of a recording so that they stay in
/// step. Set by the first that starts.
class ReplayTimeline {
 public:
  void start(HostTime recorded, HostTime now) {
    if (!shift_) shift_ = now - recorded;
  }
  void rewind() { shift_.reset(); }
  /// Once more, also while it runs: a device that came back begins where it did then.
  void restart(HostTime recorded, HostTime now) { shift_ = now - recorded; }
  [[nodiscard]] bool running() const { return shift_.has_value(); }
  [[nodiscard]] HostTime due(HostTime recorded) const {
    return shift_ ? recorded + *shift_ : HostTime::max();
  }
  [[nodiscard]] HostTime recorded(HostTime now) const {
    return now - shift_.value_or(std::chrono::nanoseconds{0});
  }

 private:
  std::optional<std::chrono::nanoseconds> shift_;
};

}  // namespace abbe::sim
