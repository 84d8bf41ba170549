#pragma once
/// Replays the encoders of a recording on their CAN port.
///   - The n-th SYNC is answered with the frames that answered the n-th recorded SYNC, with their
///     recorded delay.
///   - An SDO request gets the recorded response to the same request, or none if there was none.
///   - All other frames (heartbeats, EMCY, error frames, the SYNC of another producer and the
///     positions that answered it) are sent with their original timing.
///
/// Before the replay starts, heartbeats are sent and every SYNC is answered with the first recorded
/// positions, so that the nodes appear alive. If the recording has no tracker, the replay starts
/// with the first SYNC; if it has no SYNC to the nodes either, it starts as soon as there is a
/// listener. Steppable, not thread-safe.

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
  /// `timeline` must outlive the bus. `leads`: this device starts the timeline, because the
  /// recording has no tracker.
  [[nodiscard]] static Result<RecordedBus> open(const EncoderBusOptions& options,
                                                const RecordedDevice& device,
                                                ReplayTimeline& timeline, bool leads);

  void poll(HostTime now);
  [[nodiscard]] HostTime next_due() const;
  [[nodiscard]] int fd() const { return port_->fd(); }
  [[nodiscard]] std::uint16_t port() const { return port_->port(); }
  [[nodiscard]] bool finished() const {
    return timeline_.running() && next_unsolicited_ >= unsolicited_.size();
  }
  [[nodiscard]] std::size_t syncs() const { return cycles_.size() + foreign_syncs_; }

 private:
  struct Answer {
    std::chrono::nanoseconds delay{};  ///< delay after the SYNC
    can::CanFrame frame;
  };
  struct Cycle {
    HostTime sync;
    std::vector<Answer> answers;
  };
  /// A frame that is sent without a request.
  struct Unsolicited {
    HostTime time;
    can::CanFrame frame;
  };
  using SdoRequest = std::pair<std::uint32_t, std::array<std::byte, 8>>;
  struct SdoResponses {
    std::vector<std::optional<can::CanFrame>> frames;  ///< nullopt: the node did not answer
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
  /// True if all SYNCs of the recording came from another producer.
  [[nodiscard]] bool external() const { return cycles_.empty() && foreign_syncs_ > 0; }
  [[nodiscard]] std::size_t cycle_at(HostTime recorded) const;

  std::unique_ptr<CanPort> port_;
  ReplayTimeline& timeline_;
  bool leads_;
  std::set<can::NodeId> nodes_;
  std::vector<Cycle> cycles_;
  std::size_t foreign_syncs_ = 0;
  /// used while the recording is read: the latest SYNC came from another producer
  bool foreign_sync_ = false;
  std::vector<Unsolicited> unsolicited_;
  std::vector<Unsolicited> late_;  ///< delayed answers of current cycles, ordered by sending time
  std::map<SdoRequest, SdoResponses> sdo_;
  /// used while the recording is read: requests without a response yet
  std::map<can::NodeId, SdoRequest> asked_;
  std::optional<std::size_t> next_cycle_;
  std::size_t next_unsolicited_ = 0;
  HostTime next_beat_ = HostTime::min();
  can::NodeState state_ = can::NodeState::PreOperational;
};

}  // namespace abbe::sim
