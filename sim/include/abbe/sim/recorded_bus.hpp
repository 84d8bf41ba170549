#pragma once
/// The encoders of a recording on their port again. The n-th SYNC from the start is answered with
/// the frames that answered the n-th SYNC then, as late as then, SDO requests with the recorded
/// responses to the same request or with silence where that was the answer, everything else
/// (heartbeats, EMCY, error frames, the SYNC of another producer and the positions that answered
/// it) comes with its original timing. Until the recording starts nodes are kept alive with
/// heartbeats and the first positions. Without a tracker in the recording it starts with the first
/// SYNC, or, where none was sent to the nodes, as soon as somebody listens. Steppable, not
/// thread-safe.

#include <map>
#include <memory>
#include <optional>
#include <set>
#include <vector>

#include "abbe/protocol/can/canopen.hpp"
#include "abbe/protocol/can/frame.hpp"
#include "abbe/sim/encoder_bus.hpp"
#include "abbe/sim/recorded_traffic.hpp"

namespace abbe::sim {

class RecordedBus {
 public:
  /// `timeline` must outlive it. `leads`: it starts the timeline, because no tracker does.
  [[nodiscard]] static Result<RecordedBus> open(const EncoderBusOptions& options,
                                                const RecordedDevice& device,
                                                ReplayTimeline& timeline, bool leads);

  void poll(HostTime now);
  [[nodiscard]] HostTime next_due() const;
  [[nodiscard]] int fd() const { return port_->fd(); }
  [[nodiscard]] std::uint16_t port() const { return port_->port(); }
  [[nodiscard]] bool finished() const {
    return timeline_.running() && next_spoken_ >= spoken_.size();
  }
  [[nodiscard]] std::size_t syncs() const { return cycles_.size() + foreign_syncs_; }

 private:
  struct Answer {
    std::chrono::nanoseconds delay{};  ///< after the SYNC
    can::CanFrame frame;
  };
  struct Cycle {
    HostTime sync;
    std::vector<Answer> answers;
  };
  struct Spoken {
    HostTime time;
    can::CanFrame frame;
  };
  using SdoRequest = std::pair<std::uint32_t, std::array<std::byte, 8>>;
  struct SdoResponses {
    std::vector<std::optional<can::CanFrame>> frames;  ///< nothing: the node did not answer
    std::size_t next = 0;
  };

  RecordedBus(std::unique_ptr<CanPort> port, const RecordedDevice& device, ReplayTimeline& timeline,
              bool leads);
  void take(const can::CanFrame& frame, bool to_device, HostTime time);
  void on_frame(const can::CanFrame& frame, HostTime now);
  void on_sync(HostTime now);
  void answer(const Cycle& cycle, HostTime now);
  void send_late(HostTime now);
  void on_sdo(const can::CanFrame& frame);
  void keep_alive(HostTime now);
  /// Nothing but the SYNC of another producer was on the bus.
  [[nodiscard]] bool external() const { return cycles_.empty() && foreign_syncs_ > 0; }
  [[nodiscard]] std::size_t cycle_at(HostTime recorded) const;

  std::unique_ptr<CanPort> port_;
  ReplayTimeline& timeline_;
  bool leads_;
  std::set<can::NodeId> nodes_;
  std::vector<Cycle> cycles_;
  std::size_t foreign_syncs_ = 0;
  /// while the recording is read: the latest SYNC was another producer's
  bool foreign_sync_ = false;
  std::vector<Spoken> spoken_;
  std::vector<Spoken> late_;  ///< of cycles already asked for, by the time they leave
  std::map<SdoRequest, SdoResponses> sdo_;
  std::map<can::NodeId, SdoRequest>
      asked_;  ///< while the recording is read: requests without a response yet
  std::optional<std::size_t> next_cycle_;
  std::size_t next_spoken_ = 0;
  HostTime next_beat_ = HostTime::min();
  can::NodeState state_ = can::NodeState::PreOperational;
};

}  // namespace abbe::sim
