#pragma once
/// Which tracker points belong to one on-the-fly run: from the standstill at the first vertex of
/// the path to the standstill at the last. Decided from snapshots alone, never from a clock, so
/// that a replay takes the very same points. Ordinary world; not thread-safe; lengths m, axis
/// positions as scale readings in the order X, Y, Z.

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "abbe/base/axis_position.hpp"
#include "abbe/calib/otf/path_index.hpp"
#include "abbe/calib/otf/run.hpp"
#include "abbe/pipeline/acquisition_phase.hpp"
#include "abbe/pipeline/environment_use.hpp"
#include "abbe/pipeline/vertex_readings.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::daemon {

/// One point of the run as identification sees it.
struct RunPoint {
  protocol::HostTime time{};
  protocol::DeviceTime device_time{};
  std::array<double, 3> p_tracker_m{};
  bool usable =
      /// false: too fast, prism error or trigger violation; it holds its place in the sequence
      true;
};

/// Points of a run in blocks: one more never copies those before.
class RunPoints {
 public:
  void push_back(const RunPoint& point);
  void pop_back() noexcept;
  [[nodiscard]] const RunPoint& back() const noexcept { return blocks_.back().back(); }
  [[nodiscard]] bool empty() const noexcept { return blocks_.empty(); }
  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  /// All of them, O(n).
  [[nodiscard]] std::vector<RunPoint> joined() const;

 private:
  std::vector<std::vector<RunPoint>> blocks_;  // none is empty
  std::size_t size_ = 0;
};

struct AcquisitionOptions {
  double stand_tolerance_m = 0.2e-3;  ///< a machine that moves less than this is standing
  /// how near to the first and last vertex the machine must stand
  double vertex_tolerance_m = 2e-3;
  double reading_tolerance_m = 20e-6;  ///< see VertexReadings
  /// farther from every leg than this means another path is being driven
  double path_tolerance_m = 10e-3;
  /// 20 points at 100 Hz, see [calib] alignment
  std::chrono::nanoseconds stand_before = std::chrono::milliseconds{200};
  /// standstill kept in front of the run
  std::chrono::nanoseconds keep_before = std::chrono::milliseconds{400};
  /// longer than any dwell at a vertex
  std::chrono::nanoseconds stand_after = std::chrono::milliseconds{1000};
  std::chrono::nanoseconds keep_after =
      std::chrono::milliseconds{400};  ///< standstill kept behind the run
  /// Inside the run: between two tracker points, or without axis positions, for longer ends it.
  std::chrono::nanoseconds silence = std::chrono::seconds{30};
  /// Host time for which no point need have arrived: `silence` and the backlog a stalled tracker
  /// delivers.
  std::chrono::nanoseconds arrival_time_out = std::chrono::seconds{40};
  /// for the machine to stand at P0 and leave
  std::chrono::nanoseconds wait_for_start = std::chrono::hours{1};
  std::chrono::nanoseconds longest_stop =
      std::chrono::minutes{15};  ///< on the path: a longer one ends the run
  /// Of a run: 67 min at 1000 points a second, 200 MB. A machine that cycles on its path would fill
  /// the memory.
  std::size_t most_points = 4'000'000;
  EnvironmentUseOptions environment;  ///< what snapshots were corrected with
  /// A packet out of order goes back by a burst (a third of a second); a clock that began anew by
  /// more.
  std::chrono::nanoseconds clock_began_anew = std::chrono::seconds{1};
};

class OtfAcquisition {
 public:
  using Phase = AcquisitionPhase;

  /// `path_m`: vertices of the polyline, at least two. O(n): everything that grows with the path, but
  /// release(), is done here.
  explicit OtfAcquisition(std::vector<AxisPosition> path_m, AcquisitionOptions options = {});

  /// Before the first snapshot. Those before `from` are not looked at.
  void begin(protocol::HostTime from) noexcept { from_ = from; }
  /// Points whose device time does not ascend are left out and counted.
  void take(const protocol::Snapshot& snapshot);
  /// Fails what nothing arrives for any more; `now` is host time. Never needed for a replay: what
  /// it fails has no points that could complete it.
  void tick(protocol::HostTime now);

  [[nodiscard]] Phase phase() const noexcept { return phase_; }
  [[nodiscard]] const std::string& reason() const noexcept {
    return reason_;
  }                                                ///< why Failed, or what is waited for
  [[nodiscard]] double progress() const noexcept;  ///< 0 to 1 of the path length driven
  [[nodiscard]] std::size_t points() const noexcept { return points_.size(); }
  /// The points of the run; O(n).
  [[nodiscard]] std::vector<RunPoint> release() { return std::exchange(points_, {}).joined(); }
  /// The path of the request; O(1).
  [[nodiscard]] std::vector<AxisPosition> release_path() { return std::exchange(path_m_, {}); }
  [[nodiscard]] const AcquisitionOptions& options() const noexcept { return options_; }
  /// Mean over the run.
  [[nodiscard]] EnvironmentEffect environment() const { return environment_.mean(); }

 private:
  [[nodiscard]] bool in_order(const RunPoint& point);
  void give_up_if_stuck(protocol::HostTime point_time);
  void keep(const RunPoint& point);
  void wait_at_start(const RunPoint& point, const calib::Vector3& q);
  void run(const RunPoint& point, const calib::Vector3& q);
  void track_standstill(const RunPoint& point, const calib::Vector3& q);
  void follow_path(const RunPoint& point, const calib::Vector3& q);
  /// Fails where the scales read something else than the path says.
  void compare_with_path(const protocol::Snapshot& snapshot, const calib::Vector3& q);
  [[nodiscard]] bool complete(protocol::HostTime now, const calib::Vector3& q) const;
  void trim_end();
  void fail(std::string reason);

  std::vector<AxisPosition> path_m_;
  calib::otf::PathIndex path_;
  std::vector<double> driven_at_m_;  // every vertex
  protocol::HostTime from_{};
  AcquisitionOptions options_;
  Phase phase_ = Phase::WaitingAtStart;
  std::string reason_;
  std::deque<RunPoint> before_;  // standstill at the first vertex, the last keep_before of it
  RunPoints points_;
  MeanEffect environment_;
  VertexReadings readings_{options_.reading_tolerance_m};
  std::optional<std::pair<protocol::HostTime, calib::Vector3>>
      before_q_;                                      // the last known positions
  calib::Vector3 stand_at_ = calib::Vector3::Zero();  // where the current standstill began
  protocol::HostTime stand_since_{};
  bool stand_known_ = false;
  std::size_t leg_ = 0;             // the machine is on, or just before, this leg
  protocol::HostTime on_leg_at_{};  // when it was last seen there
  double driven_m_ = 0.0;           // along the path, up to the machine
  protocol::HostTime axes_known_at_{};
  protocol::HostTime last_time_{};
  std::optional<protocol::DeviceTime> last_device_time_;
  std::size_t disordered_ = 0;
};

}  // namespace abbe::daemon
