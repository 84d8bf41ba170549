#pragma once
/// Reads the raw bytes of a recording by device, as they were transferred on the wire. They are the
/// input of a replay. Accepts complete and damaged MCAP files; only messages on abbe/v1/RawBytes
/// are used. Pure; allocates.

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
  std::vector<std::byte> bytes;  ///< bytes of one read or write; continued blocks are joined

  /// True for an empty block from a device: a new connection begins (for encoders: no frame arrived
  /// until this time).
  [[nodiscard]] bool connects() const { return !to_device && bytes.empty(); }
  /// True for an empty block to a device: the connection was lost, and the daemon had not closed
  /// it.
  [[nodiscard]] bool lost() const { return to_device && bytes.empty(); }
};

enum class RecordedKind {
  Tracker,      ///< emScon packets
  Encoders,     ///< CAN frames in datagrams, for every kind of bus
  CounterCard,  ///< USB/IP messages, for every transport
  ModbusTcp,
  ModbusRtu,
  MeasuringMachine,  ///< lines of I++ DME
  Lines,             ///< tracker points as lines of text
};

struct RecordedDevice {
  std::string name;
  RecordedKind kind{};
  std::vector<RecordedBlock> blocks;
};

/// Detects the protocol by the bytes that were sent to the device, else by the bytes that the
/// device sent. Lines: text, and nothing was sent to the device. Tracker if no protocol matches.
[[nodiscard]] RecordedKind kind_of(std::span<const RecordedBlock> blocks);

/// The text of the configuration a recording was made with; empty if there is none.
[[nodiscard]] std::string recorded_configuration(std::span<const std::byte> file);

/// Reads the raw bytes of all devices. `name` is the file name in error texts. Error BadInput: not
/// an MCAP file, or no raw bytes in it.
[[nodiscard]] Result<std::vector<RecordedDevice>> read_traffic(std::span<const std::byte> file,
                                                               std::string_view name);

/// Largest permitted difference between the time of an event in the replay and the time at which
/// the timeline maps it. A replay that is further off is synchronised with the timeline again.
inline constexpr std::chrono::milliseconds kOutOfStep{50};

/// Converts recorded time to replay time. All devices of a replay share one timeline, so that they
/// stay synchronised. The first device that starts sets the conversion.
class ReplayTimeline {
 public:
  void start(HostTime recorded, HostTime now) {
    if (!shift_) shift_ = now - recorded;
  }
  void rewind() { shift_.reset(); }
  /// Sets the conversion again, also while the timeline runs: a device that reconnects continues at
  /// its recorded time.
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
