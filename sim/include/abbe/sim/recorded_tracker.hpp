#pragma once
/// A tracker controller that says again what it said in a recording. Commands are answered with the
/// recording's own answers to the same command, in their order, the last one for ever; a command nobody sent
/// then is answered NotImplemented. What was not an answer (bursts, errors, events) comes with its original
/// timing from the moment measuring starts. Interface as TrackerDevice.

#include <map>
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
  /// Also rewinds: the next client sees the recording from its start.
  void disconnected();
  void receive(std::span<const std::byte> bytes, HostTime now);
  void advance(HostTime now);
  [[nodiscard]] HostTime next_due() const;
  [[nodiscard]] std::vector<std::byte> take_output();
  [[nodiscard]] bool wants_close() const { return wants_close_; }
  [[nodiscard]] bool accepts() const { return true; }

  /// Everything has been served.
  [[nodiscard]] bool finished() const { return playing_ && next_ >= spoken_.size(); }
  [[nodiscard]] std::size_t packets() const { return spoken_.size(); }

 private:
  using Packet = std::vector<std::byte>;
  struct Spoken {
    HostTime time;
    Packet packet;
  };
  struct Answers {
    std::vector<Packet> packets;
    std::size_t next = 0;
  };

  void take(std::span<const std::byte> packet, HostTime time);
  void answer(std::span<const std::byte> request, HostTime now);
  void say(std::span<const std::byte> packet) { out_.insert(out_.end(), packet.begin(), packet.end()); }

  ReplayTimeline& timeline_;
  protocol::emscon::PacketFramer framer_;
  std::map<std::int32_t, Answers> answers_;  ///< by command
  std::vector<Spoken> spoken_;               ///< not answers; from the first start of a measurement on
  std::optional<HostTime> started_;          ///< in recorded time
  bool playing_ = false;
  std::size_t next_ = 0;
  bool wants_close_ = false;
  std::vector<std::byte> out_;
};

}  // namespace abbe::sim
