#pragma once
/// A device that only speaks when it is spoken to, saying again what it said in a recording: Modbus
/// over TCP or RTU, I++ DME. The n-th of equal requests on a connection is answered as the n-th was
/// then: after the same time, in the same pieces, or not at all; when there were no more, as the
/// last one. A connection that broke then breaks again, and the next one goes on where the next one
/// did then; after the last one all begins anew. What nobody asked then is refused. Interface as
/// TrackerDevice; steppable, not thread-safe.

#include <deque>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "abbe/sim/recorded_traffic.hpp"

namespace abbe::sim {

/// How one protocol cuts a stream of bytes into requests, and what of a request makes it another
/// one.
struct DialogueWire {
  using Bytes = std::span<const std::byte>;
  /// Of the first request in `bytes`; 0: it is not whole yet.
  std::size_t (*request_size)(Bytes bytes) = nullptr;
  /// What two requests must have in common to get the same answer: all but their number.
  Bytes (*meaning)(Bytes request) = nullptr;
  /// Gives an answer to the `recorded` request the number of the one that is answered now.
  void (*renumber)(std::span<std::byte> answer, Bytes recorded, Bytes request) = nullptr;
  std::vector<std::byte> (*refusal)(Bytes request) = nullptr;
};
/// Of ModbusTcp, ModbusRtu and MeasuringMachine.
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

  /// What was asked last then has been asked and answered.
  [[nodiscard]] bool finished() const { return finished_; }
  [[nodiscard]] std::size_t requests() const;

 private:
  struct Piece {
    std::chrono::nanoseconds delay{};  ///< from the request
    std::vector<std::byte> bytes;
    bool breaks = false;  ///< the connection, after this
  };
  struct Exchange {
    std::vector<std::byte> request;  ///< empty: what came before anything was asked
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
  bool serial_;  ///< a line nobody sees being opened: all is one connection
  std::vector<Connection> connections_;
  std::size_t connection_ = 0;
  bool played_ = false;                          ///< the present connection has been begun
  std::map<std::string, std::size_t> answered_;  ///< on the present connection
  std::vector<std::byte> incoming_;
  std::deque<Due> due_;
  std::vector<std::byte> out_;
  bool wants_close_ = false;
  bool finished_ = false;
};

}  // namespace abbe::sim
