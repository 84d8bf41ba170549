#pragma once
/// The lines of a device from a recording, sent again read by read with their original timing. The
/// time runs from the first connection on. A connection that broke in the recording breaks again;
/// the next one replays the next recorded one, and after the last one the recording begins again.
/// Interface as LineSource.

#include <string>
#include <vector>

#include "abbe/sim/recorded_traffic.hpp"

namespace abbe::sim {

class RecordedLines {
 public:
  /// `timeline` must outlive it. `leads`: a connection sets the timeline; else another device does,
  /// and what was recorded before it is not sent.
  RecordedLines(const RecordedDevice& device, ReplayTimeline& timeline, bool leads = true);

  void connected(HostTime now);
  void disconnected();
  void advance(HostTime now);
  [[nodiscard]] HostTime next_due() const;
  [[nodiscard]] std::string take_output();
  [[nodiscard]] bool take_hang_up();

  /// The whole recording has been sent.
  [[nodiscard]] bool finished() const { return finished_; }
  /// With bytes.
  [[nodiscard]] std::size_t reads() const;

 private:
  struct Connection {
    HostTime began{};
    std::vector<RecordedBlock> blocks;  ///< from the device; without bytes: the connection breaks
  };
  [[nodiscard]] const Connection& connection() const { return connections_[connection_]; }

  void print(const RecordedBlock& block);

  ReplayTimeline& timeline_;
  bool leads_;
  bool within_line_ = false;  ///< the bytes before were not sent
  std::vector<Connection> connections_;
  std::size_t connection_ = 0;
  std::size_t next_ = 0;  ///< block of the connection
  bool played_ = false;   ///< a receiver was connected before
  bool connected_ = false;
  bool finished_ = false;
  bool hang_up_ = false;
  std::string out_;
};

}  // namespace abbe::sim
