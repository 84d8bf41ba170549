#pragma once
/// The raw bytes of a recording, device by device, as they crossed the wire: what a replay serves. Reads the
/// MCAP file whole or broken; only messages on abbe/v1/RawBytes are looked at. Pure but for memory.

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
  std::vector<std::byte> bytes;  ///< of one read or one write: continued blocks are joined
};

enum class RecordedKind { Tracker, Encoders };

struct RecordedDevice {
  std::string name;
  RecordedKind kind{};  ///< encoders: the bytes are CAN frames in datagrams
  std::vector<RecordedBlock> blocks;
};

/// `name` stands in the errors. BadInput: no MCAP file, or one without raw bytes.
[[nodiscard]] Result<std::vector<RecordedDevice>> read_traffic(std::span<const std::byte> file,
                                                               std::string_view name);

/// Recorded time -> time of the replay, shared by all devices of a recording so that they stay in step. Set
/// by the first that starts.
class ReplayTimeline {
 public:
  void start(HostTime recorded, HostTime now) {
    if (!shift_) shift_ = now - recorded;
  }
  void rewind() { shift_.reset(); }
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
