#pragma once
/// Replays a tracker controller from a recording. The n-th of several equal commands on a
/// connection is answered like the n-th such command in the recording: after the same time or not
/// at all. When the recording has no further such command, the last answer is repeated. A command
/// that is not in the recording is answered with NotImplemented. All other packets (bursts, errors,
/// events, bytes that are not a packet) are sent with their original timing from the start of
/// measuring. A connection that broke in the recording breaks again. The next connection replays
/// the next recorded one; after the last one the replay begins again with the first. Interface as
/// TrackerDevice.

#include <deque>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "abbe/protocol/emscon/framer.hpp"
#include "abbe/sim/recorded_traffic.hpp"

namespace abbe::sim {

class RecordedTracker {
 public:
  /// `timeline` must outlive this object.
  RecordedTracker(const RecordedDevice& device, ReplayTimeline& timeline);

  void connected(HostTime now);
  void disconnected();
  void receive(std::span<const std::byte> bytes, HostTime now);
  void advance(HostTime now);
  [[nodiscard]] HostTime next_due() const;
  [[nodiscard]] std::vector<std::byte> take_output();
  [[nodiscard]] bool wants_close() const { return wants_close_; }
  [[nodiscard]] bool accepts() const { return true; }

  /// True if the whole recording has been sent.
  [[nodiscard]] bool finished() const { return finished_; }
  [[nodiscard]] std::size_t packets() const;

 private:
  using Packet = std::vector<std::byte>;
  /// A packet that is sent without a command.
  struct Unsolicited {
    HostTime time;
    Packet packet;
    bool breaks = false;  ///< the connection breaks; `packet` is then empty
  };
  struct Exchange {
    HostTime asked{};
    HostTime answered{};
    std::vector<Packet> answers;  ///< empty: the controller did not answer
    std::size_t wanted = 1;
  };
  struct Connection {
    HostTime began{};
    std::map<std::int32_t, std::vector<Exchange>> exchanges;  ///< exchanges by command
    std::vector<Unsolicited> unsolicited;
    std::optional<HostTime> first_start;
    bool garbled = false;  ///< used while the recording is read: bytes that are not packets
  };
  struct Due {
    HostTime time;
    std::vector<Packet> packets;
    std::optional<HostTime> starts;  ///< recorded time of the start of measuring
    bool stops = false;
  };

  void read(const RecordedBlock& block);
  void take(std::span<const std::byte> packet, HostTime time);
  void take_answer(std::int32_t command, std::span<const std::byte> packet, HostTime time);
  void answer(std::span<const std::byte> request, HostTime now);
  void carry_out(const Due& due);
  [[nodiscard]] HostTime unsolicited_due() const;
  [[nodiscard]] const Connection& connection() const { return connections_[connection_]; }
  void send_packet(std::span<const std::byte> packet) {
    out_.insert(out_.end(), packet.begin(), packet.end());
  }

  ReplayTimeline& timeline_;
  protocol::emscon::PacketFramer framer_;
  std::vector<Connection> connections_;
  std::size_t connection_ = 0;
  bool played_ = false;                   ///< a client has connected before
  std::optional<HostTime> connected_at_;  ///< nullopt: no client
  /// number of answers given on the present connection, by command
  std::map<std::int32_t, std::size_t> answered_;
  std::deque<Due> due_;
  std::size_t next_ = 0;   ///< index of the next unsolicited packet
  bool anchored_ = false;  ///< measuring was started on the present connection
  bool stopped_ = false;
  bool finished_ = false;
  bool wants_close_ = false;
  std::vector<std::byte> out_;
};

}  // namespace abbe::sim
