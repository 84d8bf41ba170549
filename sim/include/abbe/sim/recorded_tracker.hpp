#pragma once
/// A tracker controller that says again what it said in a recording. The n-th of equal commands on
/// a connection is answered as the n-th was then, after the same time or not at all, when there
/// were no more as the last one; a command nobody sent then is answered NotImplemented. What was
/// not an answer (bursts, errors, events, bytes that are no packet) comes with its original timing
/// from the moment measuring starts. A connection that broke then breaks again, and the next one
/// goes on where the next one did; after the last one all begins anew. Interface as TrackerDevice.

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
  /// `timeline` must outlive it.
  RecordedTracker(const RecordedDevice& device, ReplayTimeline& timeline);

  void connected(HostTime now);
  void disconnected();
  void receive(std::span<const std::byte> bytes, HostTime now);
  void advance(HostTime now);
  [[nodiscard]] HostTime next_due() const;
  [[nodiscard]] std::vector<std::byte> take_output();
  [[nodiscard]] bool wants_close() const { return wants_close_; }
  [[nodiscard]] bool accepts() const { return true; }

  /// Everything has been served.
  [[nodiscard]] bool finished() const { return finished_; }
  [[nodiscard]] std::size_t packets() const;

 private:
  using Packet = std::vector<std::byte>;
  struct Spoken {
    HostTime time;
    Packet packet;
    bool breaks = false;  ///< the connection, instead of saying something
  };
  struct Exchange {
    HostTime asked{};
    HostTime answered{};
    std::vector<Packet> answers;  ///< none: the controller said nothing
    std::size_t wanted = 1;
  };
  struct Connection {
    HostTime began{};
    std::map<std::int32_t, std::vector<Exchange>> exchanges;  ///< by command
    std::vector<Spoken> spoken;
    std::optional<HostTime> first_start;
    bool garbled = false;  ///< while it is read: bytes that are no packets
  };
  struct Due {
    HostTime time;
    std::vector<Packet> packets;
    std::optional<HostTime> starts;  ///< measuring, at this recorded time
    bool stops = false;
  };

  void read(const RecordedBlock& block);
  void take(std::span<const std::byte> packet, HostTime time);
  void take_answer(std::int32_t command, std::span<const std::byte> packet, HostTime time);
  void answer(std::span<const std::byte> request, HostTime now);
  void carry_out(const Due& due);
  [[nodiscard]] HostTime spoken_due() const;
  [[nodiscard]] const Connection& connection() const { return connections_[connection_]; }
  void say(std::span<const std::byte> packet) {
    out_.insert(out_.end(), packet.begin(), packet.end());
  }

  ReplayTimeline& timeline_;
  protocol::emscon::PacketFramer framer_;
  std::vector<Connection> connections_;
  std::size_t connection_ = 0;
  bool played_ = false;                           ///< the present connection has been begun
  std::optional<HostTime> connected_at_;          ///< nothing: nobody listens
  std::map<std::int32_t, std::size_t> answered_;  ///< on the present connection
  std::deque<Due> due_;
  std::size_t next_ = 0;   ///< of what is spoken
  bool anchored_ = false;  ///< measuring was started on the present connection
  bool stopped_ = false;
  bool finished_ = false;
  bool wants_close_ = false;
  std::vector<std::byte> out_;
};

}  // namespace abbe::sim
