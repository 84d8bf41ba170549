#pragma once
/// A tracker whose measuring program prints its points as lines of text, without its transport: a
/// time in, text out. It measures while a receiver is connected, and prints a burst every 332 ms (5
/// to 95 %: 324 to 344), as the programs of the manufacturers do. Not thread-safe.
///
/// The grid of points and their noise are those of TrackerDevice: the n-th point of a run has the
/// same noise.

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "abbe/protocol/lines/tracker_line.hpp"
#include "abbe/sim/fault.hpp"
#include "abbe/sim/tracker_model.hpp"

namespace abbe::sim {

namespace lines = protocol::lines;

struct LineTrackerOptions {
  TrackerModel model;
  /// from a point to the earliest burst that contains it
  std::chrono::nanoseconds delay = std::chrono::milliseconds{1};
  std::chrono::nanoseconds separation = std::chrono::milliseconds{2};
  /// What is printed. Status: the first valid status of the format, or "1".
  lines::LineFormat format;
};

/// One line, with LF. `p_tracker_m`: position; `t`: of the tracker's clock.
[[nodiscard]] std::string print_line(const lines::LineFormat& format,
                                     const Eigen::Vector3d& p_tracker_m, DeviceTime t, bool valid);

class LineTracker {
 public:
  /// The tracker is switched on at `now`. `machine` must outlive it.
  LineTracker(const LineTrackerOptions& options, const VirtualMachine& machine, HostTime now);

  /// A receiver is connected from now on, or none any more: what is measured meanwhile is lost.
  void connected(HostTime now);
  void disconnected();
  /// Measures and prints everything that is due until `now`.
  void advance(HostTime now);
  [[nodiscard]] HostTime next_due() const;
  /// The lines printed since the last call.
  [[nodiscard]] std::string take_output();
  /// True once after a fault that breaks the connection.
  [[nodiscard]] bool take_hang_up();

  /// Faults: BeamBreak and ReflectorAway (no points), PrismError and SpeedExceeded (invalid
  /// status), Stall, Mute, Disconnect, TrackerGarbage (a line that is no point).
  void inject(const Fault& fault, HostTime now);

  [[nodiscard]] std::optional<HostTime> first_stream() const { return first_stream_; }
  [[nodiscard]] std::uint64_t points_sent() const { return points_sent_; }

 private:
  void print_burst(HostTime at);

  LineTrackerOptions options_;
  const VirtualMachine& machine_;
  HostTime power_on_;
  std::optional<DeviceTime> grid_;  ///< time of the point number 0
  std::uint64_t next_point_ = 0;    ///< on the grid
  std::optional<HostTime> next_burst_;
  std::uint64_t bursts_ = 0;
  std::uint64_t points_sent_ = 0;
  std::optional<HostTime> first_stream_;
  std::string out_;
  bool hang_up_ = false;
  MeasuringTime beam_broken_, invalid_;
  HostTime mute_until_ = HostTime::min();
  HostTime stall_until_ = HostTime::min();
};

}  // namespace abbe::sim
