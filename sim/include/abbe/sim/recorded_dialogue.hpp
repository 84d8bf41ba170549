#pragma once
/// Replays a device that only answers requests: Modbus over TCP or RTU, I++ DME. The n-th of
/// several equal requests on a connection is answered like the n-th such request in the recording:
/// after the same time, in the same pieces, or not at all. When the recording has no further such
/// request, the last answer is repeated. A request that is not in the recording is refused. A
/// connection that broke in the recording breaks again. The next connection replays the next
/// recorded one; after the last one the replay begins again with the first. Interface as
/// TrackerDevice; steppable, not thread-safe.

#include <deque>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "abbe/sim/recorded_traffic.hpp"

namespace abbe::sim {

/// Functions of one protocol that split a stream of bytes into requests and compare requests. The
/// number of a request is its transaction number or tag, which its answer repeats.
struct DialogueWire {
  using Bytes = std::span<const std::byte>;
  /// Size of the first request in `bytes`; 0: the request is incomplete.
  std::size_t (*request_size)(Bytes bytes) = nullptr;
  /// The part of a request that must be equal for two requests to get the same answer: all except
  /// the number.
  Bytes (*meaning)(Bytes request) = nullptr;
  /// Replaces the number of the `recorded` request in its answer by the number of `request`.
  void (*renumber)(std::span<std::byte> answer, Bytes recorded, Bytes request) = nullptr;
  /// The answer to a request that is not in the recording.
  std::vector<std::byte> (*refusal)(Bytes request) = nullptr;
};
/// The functions for ModbusTcp, ModbusRtu or MeasuringMachine.
[[nodiscard]] const DialogueWire& dialogue_wire(RecordedKind kind);

class RecordedDialogue {
 public:
  RecordedDialogue(const RecordedDevice& device, const DialogueWire& wire);

  void connected(HostTime now);
  void disconnected();
  void receive(std::span<const std::byte> bytes, HostTime now);
  void advance(HostTime now);
  [[nodiscard]] HostTime next_due() const;
  [[nodiscard]] std::vector<std::byte> take_output();
  [[nodiscard]] bool wants_close() const { return wants_close_; }
  [[nodiscard]] bool accepts() const { return true; }

  /// True once the last request of the recording has been received and answered.
  [[nodiscard]] bool finished() const { return finished_; }
  [[nodiscard]] std::size_t requests() const;

 private:
  struct Piece {
    std::chrono::nanoseconds delay{};  ///< delay after the request
    std::vector<std::byte> bytes;
    bool breaks = false;  ///< the connection breaks after this piece
  };
  struct Exchange {
    std::vector<std::byte> request;  ///< empty: the device sent the answer before any request
    HostTime time{};
    std::vector<Piece> answer;
  };
  struct Connection {
    std::vector<Exchange> exchanges;
    std::map<std::string, std::vector<std::size_t>> by_meaning;
  };
  struct Due {
    HostTime time;
    std::vector<std::byte> bytes;
    bool breaks = false;
    bool last = false;
  };

  void take(const RecordedBlock& block);
  void index();
  [[nodiscard]] std::string meaning_of(std::span<const std::byte> request) const;
  void answer(std::span<const std::byte> request, HostTime now);
  void schedule(const Exchange& exchange, std::span<const std::byte> request, HostTime now);

  const DialogueWire& wire_;
  bool serial_;  ///< a serial line: its opening cannot be detected, so it counts as one connection
  std::vector<Connection> connections_;
  std::size_t connection_ = 0;
  bool played_ = false;  ///< a client has connected before
  /// number of answers given on the present connection, by the meaning() of their requests
  std::map<std::string, std::size_t> answered_;
  std::vector<std::byte> incoming_;
  std::deque<Due> due_;
  std::vector<std::byte> out_;
  bool wants_close_ = false;
  bool finished_ = false;
};

}  // namespace abbe::sim
