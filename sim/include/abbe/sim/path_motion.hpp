#pragma once
/// The motion that the control commands: a polyline of axis positions, trapezoidal speed along each
/// leg, an exact stop at every vertex and a dwell before every leg. Position at any time is a pure
/// function; before the start the machine stands at the first vertex, after the end at the last.
/// Times in s from the start of the motion, lengths in m. The machine can wait at inner vertices,
/// for example while the tracker measures reference nests (reference_nests.hpp).

#include <Eigen/Core>
#include <array>
#include <string_view>
#include <vector>

#include "abbe/sim/error.hpp"

namespace abbe::sim {

struct PathVertex {
  Eigen::Vector3d q_m = Eigen::Vector3d::Zero();
  double feed_m_per_s = 0.0;  ///< feed on the leg that ends at this vertex; 0: the plan's feed
};

struct PathPlan {
  std::vector<PathVertex> vertices;
  double feed_m_per_s = 2.5 / 60.0;
  double acceleration_m_per_s2 = 1.0;
  double dwell_s = 0.05;
  double wait_s = 0.0;  ///< duration of a wait at a vertex, after the dwell; 0: no wait
  /// The first wait is at the first inner vertex, the last wait at the last inner vertex. In
  /// between, the machine waits at the first vertex that it reaches at least this long after the
  /// end of a wait.
  double wait_every_s = 180.0;
};

struct AxisMotion {
  Eigen::Vector3d q_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d velocity_m_per_s = Eigen::Vector3d::Zero();
  /// sign of the last motion of each axis, 0 before the first motion
  std::array<int, 3> direction{};
};

class PathMotion {
 public:
  /// Error BadInput unless there is a vertex and feed and acceleration are positive. Legs of length
  /// zero are skipped. A wait needs a path with an inner vertex.
  [[nodiscard]] static Result<PathMotion> plan(const PathPlan& plan);

  [[nodiscard]] AxisMotion at(double time_s) const;
  [[nodiscard]] double duration_s() const { return end_s_; }
  [[nodiscard]] std::size_t legs() const { return legs_.size(); }
  /// leg_begin_s(): time at which the machine leaves the first vertex of leg i. leg_end_s(): time
  /// at which it stops at the last vertex of leg i.
  [[nodiscard]] double leg_begin_s(std::size_t i) const { return legs_[i].begin_s; }
  [[nodiscard]] double leg_end_s(std::size_t i) const;
  /// Times at which the waits begin, ascending.
  [[nodiscard]] const std::vector<double>& waits_s() const { return waits_s_; }

 private:
  struct Leg {
    Eigen::Vector3d from_m, unit;
    double length_m, speed_m_per_s, begin_s, ramp_s, cruise_s;
    std::array<int, 3> direction_before, direction;
  };
  void add_leg(const PathVertex& to, double feed_m_per_s, double begin_s);
  [[nodiscard]] AxisMotion on_leg(const Leg& leg, double time_s) const;

  Eigen::Vector3d first_m_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d last_m_ = Eigen::Vector3d::Zero();
  double acceleration_m_per_s2_ = 1.0;
  double end_s_ = 0.0;
  std::vector<Leg> legs_;
  std::vector<double> waits_s_;
};

/// Parses the text of path.csv: header `x_mm,y_mm,z_mm[,feed_mm_per_min]`, `#` comments. `name` is
/// the file name in the error text, which lists every bad line (at most 20). An empty feed cell
/// means the plan's feed.
[[nodiscard]] Result<std::vector<PathVertex>> parse_path_csv(std::string_view text,
                                                             std::string_view name);

}  // namespace abbe::sim
