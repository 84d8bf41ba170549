#pragma once
/// Checks the conditions that must hold before the machine may start an on-the-fly run. Shows them
/// as a list for the operator, and detects that the machine has started too early. Depends on the
/// points only, and on the time of tick() for streams that have stopped. Not for the RT path; not
/// thread-safe. Lengths in m; axis positions are scale readings in the order X, Y, Z.

#include <array>
#include <chrono>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "abbe/calib/geometry/rigid_transform.hpp"
#include "abbe/pipeline/session_status.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::daemon {

class StartCheck {
 public:
  struct Options {
    calib::Vector3 first_m = calib::Vector3::Zero();   ///< first vertex of the path
    calib::Vector3 second_m = calib::Vector3::Zero();  ///< the next vertex
    double vertex_tolerance_m = 2e-3;
    double path_tolerance_m = 10e-3;
    std::chrono::nanoseconds stand_before{};  ///< shortest standstill before the run
  };

  struct Point {
    protocol::HostTime time{};
    bool usable = true;                 ///< valid, and slow enough
    bool settled = true;                ///< the clock of the tracker is known
    std::optional<calib::Vector3> q_m;  ///< nullopt: axis positions are missing
    /// duration of the standstill at the first vertex, with usable points
    std::chrono::nanoseconds stood{};
  };

  /// Smallest share of usable points, and of points with axis positions, in the stream. A run is
  /// not possible with less.
  static constexpr double kShare = 0.95;

  explicit StartCheck(const Options& options);

  /// Call it for each point until the run begins, in order of time.
  void take(const Point& point);
  /// Detects streams that have stopped. `now`: host time.
  void tick(protocol::HostTime now);

  /// All conditions hold: the machine may start the run.
  [[nodiscard]] bool ready() const noexcept { return ready_; }
  /// The machine has left the first vertex along its first leg, and the run has not begun. True
  /// until all conditions hold again.
  [[nodiscard]] bool missed() const noexcept { return !missed_.empty(); }
  /// The condition that did not hold when the machine last stood at the first vertex; empty: all
  /// held.
  [[nodiscard]] const std::string& missing_at_start() const noexcept { return missing_at_start_; }
  /// Message for the operator: what to wait for, that the machine may start the run, or what was
  /// missing when it started.
  [[nodiscard]] std::string text() const;
  /// The conditions in the order in which the operator has to satisfy them: tracker, axes,
  /// position, standstill. They are at most a tenth of a second old, or 1.5 s if the tracker sends
  /// no points.
  [[nodiscard]] StartState state() const { return {ready_, missed(), conditions_}; }

 private:
  // Counts of the points in half a second, by their times.
  struct Counts {
    protocol::HostTime begin{};
    std::size_t points = 0, usable = 0, settled = 0, with_axes = 0;
  };
  static constexpr std::size_t kWindow = 4;

  [[nodiscard]] Counts recent() const noexcept;
  [[nodiscard]] bool at_start() const;
  [[nodiscard]] std::vector<StartCondition> judged() const;
  void judge(protocol::HostTime now);
  [[nodiscard]] std::string missing() const;
  enum class Departure { NearTheVertex, OnFirstLeg, ElsewhereThanThePath };
  [[nodiscard]] Departure departure(const calib::Vector3& q) const;

  Options options_;
  std::array<Counts, kWindow> window_{};  // ring, the latest at newest_
  std::size_t newest_ = 0;
  std::optional<protocol::HostTime> last_time_;
  bool silent_ = true;  // no point for kSilence
  std::optional<calib::Vector3> q_m_;
  std::chrono::nanoseconds stood_{};
  std::vector<StartCondition> conditions_;
  protocol::HostTime judged_at_{};
  bool was_at_start_ = false;
  // condition that did not hold when the machine was at the first vertex
  std::string missing_at_start_;
  bool ready_ = false;
  std::string missed_;
};

}  // namespace abbe::daemon
