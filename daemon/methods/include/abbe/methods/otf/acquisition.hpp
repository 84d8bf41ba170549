#pragma once
/// Collects the tracker points of one on-the-fly run: from the standstill at the first vertex of
/// the path to the standstill at the last. The decisions depend on snapshots only, not on a clock,
/// so that a replay takes exactly the same points. Not for the RT path; not thread-safe. Lengths in
/// m; axis positions are scale readings in the order X, Y, Z.

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "abbe/base/axis_position.hpp"
#include "abbe/calib/otf/run/path_index.hpp"
#include "abbe/calib/otf/run/run.hpp"
#include "abbe/methods/otf/start_check.hpp"
#include "abbe/methods/temperature_range.hpp"
#include "abbe/pipeline/acquisition_phase.hpp"
#include "abbe/pipeline/environment_use.hpp"
#include "abbe/pipeline/vertex_readings.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::daemon {

/// One point of the run, as the identification uses it.
struct RunPoint {
  protocol::HostTime time{};
  protocol::DeviceTime device_time{};
  std::array<double, 3> p_tracker_m{};
  /// false: the point is too fast, or has a prism error or trigger violation. It keeps its place in
  /// the sequence but is not used.
  bool usable = true;
};

/// Points of a run, stored in chunks: push_back() never copies earlier points.
class RunPoints {
 public:
  static constexpr std::size_t kPointsInChunk = 1024;  // 56 KiB: a second of a fast tracker
  /// Shared, because the live tables read full chunks on another thread: these are not changed
  /// while the run continues.
  using Chunk = std::shared_ptr<RunPoint[]>;

  void push_back(const RunPoint& point);
  void pop_back() noexcept { --size_; }
  [[nodiscard]] const RunPoint& back() const noexcept { return at(size_ - 1); }
  [[nodiscard]] bool empty() const noexcept { return size_ == 0; }
  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  /// All points in one vector; O(n).
  [[nodiscard]] std::vector<RunPoint> joined() const;

  [[nodiscard]] std::size_t full_chunks() const noexcept { return size_ / kPointsInChunk; }
  [[nodiscard]] const Chunk& full_chunk(std::size_t i) const { return chunks_[i]; }
  /// The points after the last full chunk.
  [[nodiscard]] std::vector<RunPoint> tail() const;

 private:
  [[nodiscard]] const RunPoint& at(std::size_t i) const noexcept {
    return chunks_[i / kPointsInChunk][i % kPointsInChunk];
  }
  std::vector<Chunk> chunks_;
  std::size_t size_ = 0;
};

/// The machine has reached a leg of the path, or has travelled the whole leg between two tracker
/// points. In the second case several legs have the same point.
struct LegBegun {
  AxisPosition from_m{}, to_m{};      ///< vertices of the request
  std::size_t first_point = 0;        ///< number of the point in the run
  AxisPosition q_m{}, p_tracker_m{};  ///< readings and tracker position at this point
};

/// The points and legs that were added to a run since the last call of OtfAcquisition::take_news().
struct RunNews {
  std::vector<RunPoints::Chunk> chunks;  ///< full chunks only
  std::vector<RunPoint> tail;            ///< copy of all points after the last full chunk
  std::vector<LegBegun> legs;
  EnvironmentEffect environment;  ///< mean of the run so far
};

struct AcquisitionOptions {
  /// A machine whose position stays within this distance of one place is at standstill.
  double stand_tolerance_m = 0.2e-3;
  /// largest distance of the machine from the first (last) vertex during the standstill before
  /// (after) the run
  double vertex_tolerance_m = 2e-3;
  /// largest difference between readings and vertex, see VertexReadings
  double reading_tolerance_m = 20e-6;
  /// If the machine is farther than this from every leg of the path, it follows another path, and
  /// the run fails.
  double path_tolerance_m = 10e-3;
  /// Shortest standstill before the run. The default gives, at 100 Hz, the 20 points that calib
  /// needs to align tracker and path.
  std::chrono::nanoseconds stand_before = std::chrono::milliseconds{200};
  /// length of the standstill before the run whose points are kept, counted back from its end
  std::chrono::nanoseconds keep_before = std::chrono::milliseconds{400};
  /// shortest standstill at the end; longer than any dwell at a vertex
  std::chrono::nanoseconds stand_after = std::chrono::milliseconds{1000};
  /// length of the standstill after the run whose points are kept, counted from its beginning
  std::chrono::nanoseconds keep_after = std::chrono::milliseconds{400};
  /// The run fails if, during it, no tracker point arrives for longer than this, or none with axis
  /// positions. Counted in the times of the samples.
  std::chrono::nanoseconds silence = std::chrono::seconds{30};
  /// tick() fails the run if no point arrives for longer than this host time. The value is
  /// `silence` plus the time by which a stalled tracker may deliver its points late.
  std::chrono::nanoseconds arrival_time_out = std::chrono::seconds{40};
  /// the run fails if the machine has not stopped at the first vertex and left it within this time
  std::chrono::nanoseconds wait_for_start = std::chrono::hours{1};
  /// the run fails if the machine stands still on the path for longer than this
  std::chrono::nanoseconds longest_stop = std::chrono::minutes{15};
  /// Largest number of points in a run: 67 min at 1000 points a second, 200 MB. It limits the
  /// memory in case the machine never stops at the end of the path, for example because it repeats
  /// the path.
  std::size_t most_points = 4'000'000;
  EnvironmentUseOptions environment;  ///< options with which the snapshots were corrected
  /// If the tracker's clock steps back by more than this, the clock has restarted. Packets out of
  /// order make it step back by one burst at most (a third of a second).
  std::chrono::nanoseconds clock_began_anew = std::chrono::seconds{1};
};

class OtfAcquisition {
 public:
  using Phase = AcquisitionPhase;

  /// `path_m`: vertices of the path, at least two. The constructor does all work that depends on
  /// the number n of vertices, in O(n), except the work of release().
  explicit OtfAcquisition(std::vector<AxisPosition> path_m, AcquisitionOptions options = {},
                          calib::otf::Mode mode = calib::otf::Mode::OnTheFly);

  /// Call it before the first take(). Snapshots before `from` are ignored.
  void begin(protocol::HostTime from) noexcept { from_ = from; }
  /// Takes one snapshot. A point whose device time is not later than that of the previous point is
  /// left out and counted.
  void take(const protocol::Snapshot& snapshot);
  /// Fails a run that receives no more points; `now` is host time. A replay need not call it:
  /// without the call the run stays incomplete and gives no model either.
  void tick(protocol::HostTime now);

  [[nodiscard]] Phase phase() const noexcept { return phase_; }
  /// Reason of the failure, or the event that is awaited.
  [[nodiscard]] const std::string& reason() const noexcept { return reason_; }
  /// The conditions that must hold before the run begins; null once it has begun.
  [[nodiscard]] const StartCheck* start() const noexcept {
    return phase_ == Phase::WaitingAtStart ? &start_ : nullptr;
  }
  /// travelled fraction of the path length, 0 to 1
  [[nodiscard]] double progress() const noexcept;
  [[nodiscard]] std::size_t points() const noexcept { return points_.size(); }
  /// Time to the end of the path at the speed of the last half minute; nullopt if the machine does
  /// not move.
  [[nodiscard]] std::optional<std::chrono::nanoseconds> remaining() const noexcept;
  /// False in standstill mode, whose observations are the stops and not the points in motion.
  [[nodiscard]] bool has_live_tables() const noexcept {
    return mode_ == calib::otf::Mode::OnTheFly;
  }
  /// The points and legs that were added to the run since the last call. The cost does not depend
  /// on the length of the run.
  [[nodiscard]] RunNews take_news();
  /// The points of the run; O(n).
  [[nodiscard]] std::vector<RunPoint> release() { return std::exchange(points_, {}).joined(); }
  /// The path of the request; O(1).
  [[nodiscard]] std::vector<AxisPosition> release_path() { return std::exchange(path_m_, {}); }
  [[nodiscard]] const AcquisitionOptions& options() const noexcept { return options_; }
  [[nodiscard]] calib::otf::Mode mode() const noexcept { return mode_; }  ///< mode of the request
  /// Lowest and highest temperature of the run; nullopt: not measured.
  [[nodiscard]] const std::optional<std::array<double, 2>>& temperature_K() const {
    return temperatures_.range_K();
  }
  /// Mean over the run of the effect of the environment (temperatures of the scales, air).
  [[nodiscard]] EnvironmentEffect environment() const { return environment_.mean(); }

 private:
  [[nodiscard]] bool in_order(const RunPoint& point);
  void give_up_if_stuck(protocol::HostTime point_time);
  [[nodiscard]] std::string no_start() const;
  void keep(const RunPoint& point);
  void wait_at_start(const RunPoint& point, const calib::Vector3& q);
  void check_start(const RunPoint& point, bool settled, const std::optional<calib::Vector3>& q);
  void run(const RunPoint& point, const calib::Vector3& q);
  void track_standstill(const RunPoint& point, const calib::Vector3& q);
  void follow_path(const RunPoint& point, const calib::Vector3& q);
  void begin_leg(std::size_t leg, const RunPoint& point, const calib::Vector3& q);
  void mark_way(protocol::HostTime time);
  /// Fails the run if the scale readings at a vertex differ from the path.
  void compare_with_path(const protocol::Snapshot& snapshot, const calib::Vector3& q);
  [[nodiscard]] bool complete(protocol::HostTime now, const calib::Vector3& q) const;
  void trim_end();
  void fail(std::string reason);

  std::vector<AxisPosition> path_m_;
  calib::otf::PathIndex path_;
  std::vector<double> driven_at_m_;  // length along the path from the first to each vertex
  protocol::HostTime from_{};
  AcquisitionOptions options_;
  calib::otf::Mode mode_ = calib::otf::Mode::OnTheFly;
  Phase phase_ = Phase::WaitingAtStart;
  StartCheck start_;
  std::string reason_;
  std::deque<RunPoint> before_;  // the last keep_before of the standstill at the first vertex
  // longest standstill at the first vertex, before the run
  std::chrono::nanoseconds longest_stand_{};
  RunPoints points_;
  MeanEffect environment_;
  TemperatureRange temperatures_;
  VertexReadings readings_{options_.reading_tolerance_m};
  // time and readings at the last point with axis positions
  std::optional<std::pair<protocol::HostTime, calib::Vector3>> before_q_;
  calib::Vector3 stand_at_ = calib::Vector3::Zero();  // position where the standstill began
  protocol::HostTime stand_since_{};
  bool stand_known_ = false;
  std::size_t leg_ = 0;             // leg on which the machine is, or which it is about to enter
  protocol::HostTime on_leg_at_{};  // time of the last point on this leg
  double driven_m_ = 0.0;           // length along the path up to the machine
  struct Mark {
    protocol::HostTime time{};
    double driven_m = 0.0;
  };
  std::array<Mark, 16> marks_{};  // ring, one every kMarkEvery
  std::size_t marked_ = 0;        // number of all marks
  std::deque<LegBegun> legs_;     // legs that take_news() has not returned yet
  std::size_t begun_leg_ = 0;     // the last leg that was added to legs_
  std::size_t chunks_taken_ = 0;  // number of chunks that take_news() has returned
  protocol::HostTime axes_known_at_{};
  protocol::HostTime last_time_{};
  std::optional<protocol::DeviceTime> last_device_time_;
  std::size_t disordered_ = 0;
};

}  // namespace abbe::daemon
