#pragma once
/// Finds places of a bar at which all readings stay within the travel.

#include <optional>
#include <span>
#include <vector>

#include "abbe/calib/mfb/plan/plan_positions.hpp"

namespace abbe::calib::mfb {

/// The styli that can enter holes along an axis. bar_z points against the stem of the first one.
struct StyliAlong {
  std::optional<std::size_t> against;  ///< index of the stylus with its stem along the negative
                                       ///< axis
  std::optional<std::size_t> along;    ///< index of the stylus with its stem along the positive
                                       ///< axis
};
/// Finds the styli along an axis. If several have the same stem, the longest is selected.
[[nodiscard]] StyliAlong styli_along(const PlanTask&, std::size_t axis);

/// Direction of the bar in the plane of two axes.
struct BarDirection {
  Vector3 x = Vector3::UnitX();
  double angle_rad = 0.0;  ///< angle from the first axis
};

/// Axes of the bar as columns, from bar_x and bar_z.
[[nodiscard]] Matrix3 bar_axes(const Vector3& x, const Vector3& z);

class BarPlacer {
 public:
  explicit BarPlacer(const PlanTask&);

  /// Distance from the first to the last hole.
  [[nodiscard]] double length_m() const { return length_m_; }
  [[nodiscard]] double travel_m(std::size_t axis) const { return hi_m(axis) - lo_m(axis); }
  [[nodiscard]] double lo_m(std::size_t axis) const;
  [[nodiscard]] double hi_m(std::size_t axis) const;
  /// Permitted distance of touches beyond the end nodes: the radius of a hole (a bar as long as the
  /// travel has its outer holes at the ends), but less than half a cell, the limit of observe().
  [[nodiscard]] double overhang_m(std::size_t axis) const;

  /// Range of the readings for a bar whose O_1 is at the origin.
  [[nodiscard]] ReadingRange readings(const Matrix3& axes,
                                      std::span<const std::size_t> styli) const;
  /// Range of places of O_1 for which all readings are within the travel, and all holes are in the
  /// volume that a stylus along the ram reaches. (A stylus across the ram also reaches places
  /// beside the table.) min > max: there is no such place.
  struct Room {
    Vector3 min_m, max_m;
    [[nodiscard]] bool exists() const { return (max_m - min_m).minCoeff() >= 0.0; }
  };
  [[nodiscard]] Room room(const Matrix3& axes, std::span<const std::size_t> styli) const;
  /// The possible place of O_1 that is nearest to `wanted_m`; nullopt: the bar does not fit.
  [[nodiscard]] std::optional<Vector3> nearest(const Matrix3& axes,
                                               std::span<const std::size_t> styli,
                                               const Vector3& wanted_m) const;

  /// Direction along `axis`, or inclined towards `other` by the smallest angle that the travel
  /// requires; the holes are along the third axis. `sign`: sign of the component along `other`.
  /// nullopt: the bar does not fit in the plane.
  [[nodiscard]] std::optional<BarDirection> along(std::size_t axis, std::size_t other, double sign,
                                                  const Vector3& z,
                                                  std::span<const std::size_t> styli) const;
  /// Direction as near to 45 degrees as the travel permits. `sign`: sign of the component along
  /// `second`.
  [[nodiscard]] std::optional<BarDirection> diagonal(std::size_t first, std::size_t second,
                                                     double sign, const Vector3& z,
                                                     std::span<const std::size_t> styli) const;
  /// Readings of O_1 for bars along an axis: the first bar at the lower end of the axis, the last
  /// at the upper end.
  [[nodiscard]] std::vector<double> starts_m(std::size_t axis) const;

 private:
  const PlanTask* task_;
  std::vector<NominalTouch> touches_;
  double length_m_ = 0.0;
  Vector3 ram_offset_m_;
};

}  // namespace abbe::calib::mfb
