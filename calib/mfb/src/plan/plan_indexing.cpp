#include "abbe/calib/mfb/plan/plan_indexing.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "abbe/calib/internal/statistics/elementary.hpp"

namespace abbe::calib::mfb {
namespace {

/// Orientation and place of a bar on the table with both axes at zero, if it is in the wanted
/// position at these angles.
struct Clamping {
  Matrix3 axes;
  Vector3 middle_m;  ///< middle of the bar, relative to the centre of the table
  double swivel_rad = 0.0, turn_rad = 0.0;
};

Matrix3 rotation(Axis axis, double angle_rad) {
  const SinCos a = sin_cos(angle_rad);
  const auto k = static_cast<Eigen::Index>(index(axis)), u = (k + 1) % 3, v = (k + 2) % 3;
  Matrix3 R = Matrix3::Identity();
  R(u, u) = a.cos;
  R(v, v) = a.cos;
  R(v, u) = a.sin;
  R(u, v) = -a.sin;
  return R;
}

/// True if both are the same place on the table. Tolerance: an operator may set an origin only to 5
/// mm, but the indexed positions of one clamping agree to less than 1 mm.
bool same(const Clamping& a, const Clamping& b) {
  constexpr double kSame_m = 1e-3, kSame = 1e-3;
  return (a.axes - b.axes).cwiseAbs().maxCoeff() < kSame &&
         (a.middle_m - b.middle_m).norm() < kSame_m;
}

void add_distinct(std::vector<double>& angles_rad, double angle_rad) {
  constexpr double kSame_rad = 1e-6;
  const bool known = std::any_of(angles_rad.begin(), angles_rad.end(),
                                 [&](double a) { return std::abs(a - angle_rad) < kSame_rad; });
  if (!known) {
    angles_rad.push_back(angle_rad);
  }
}

/// Angles that can be useful: multiples of 90 degrees, and the angles between the bars and the
/// axes.
std::vector<double> useful_angles(const std::vector<PlannedPosition>& positions) {
  std::vector<double> of_bars_rad{0.0};
  for (const PlannedPosition& p : positions) {
    const Vector3 x = p.pose.axes.col(0);
    for (Eigen::Index k = 0; k < 3; ++k) {
      add_distinct(of_bars_rad, std::atan2(x((k + 1) % 3), x(k)));
    }
  }
  constexpr double kQuarter_rad = 0.5 * std::numbers::pi;
  std::vector<double> all_rad;
  for (const double of_bar_rad : of_bars_rad) {
    for (int quarter = 0; quarter < 4; ++quarter) {
      for (const double sign : {1.0, -1.0}) {
        add_distinct(all_rad, std::remainder(sign * of_bar_rad + quarter * kQuarter_rad,
                                             2.0 * std::numbers::pi));
      }
    }
  }
  std::stable_sort(all_rad.begin(), all_rad.end(),
                   [](double a, double b) { return std::abs(a) < std::abs(b); });
  return all_rad;
}

std::vector<Clamping> clampings_for(const PlannedPosition& position, double length_m,
                                    const RotaryTable& table,
                                    const std::vector<double>& angles_rad) {
  constexpr double kRounding_rad = 1e-9;
  const Vector3 middle_m =
      position.pose.origin_m + 0.5 * length_m * position.pose.axes.col(0) - table.centre_m;
  std::vector<Clamping> all;
  for (const double swivel_rad : angles_rad) {
    if (swivel_rad < table.min_swivel_rad - kRounding_rad ||
        swivel_rad > table.max_swivel_rad + kRounding_rad) {
      continue;
    }
    for (const double turn_rad : angles_rad) {
      const Matrix3 R = rotation(table.swivel, swivel_rad) * rotation(Axis::Z, turn_rad);
      all.push_back(
          {R.transpose() * position.pose.axes, R.transpose() * middle_m, swivel_rad, turn_rad});
    }
  }
  return all;
}

const Clamping* find_same(const std::vector<Clamping>& all, const Clamping& wanted) {
  const auto found =
      std::find_if(all.begin(), all.end(), [&](const Clamping& c) { return same(c, wanted); });
  return found == all.end() ? nullptr : &*found;
}

/// The clamping that reaches most of the positions not yet reached; null: all are reached.
const Clamping* most_useful(const std::vector<std::vector<Clamping>>& possible,
                            const std::vector<bool>& done) {
  const Clamping* best = nullptr;
  std::size_t most = 0;
  for (std::size_t i = 0; i < possible.size(); ++i) {
    for (std::size_t c = 0; !done[i] && c < possible[i].size(); ++c) {
      std::size_t count = 0;
      for (std::size_t k = 0; k < possible.size(); ++k) {
        count += !done[k] && find_same(possible[k], possible[i][c]) != nullptr ? 1 : 0;
      }
      if (count > most) {
        most = count;
        best = &possible[i][c];
      }
    }
  }
  return best;
}

}  // namespace

std::vector<IndexedPosition> indexed_positions(const std::vector<PlannedPosition>& positions,
                                               const Bar& bar, const RotaryTable& table) {
  const std::vector<double> angles_rad = useful_angles(positions);
  std::vector<std::vector<Clamping>> possible;
  for (const PlannedPosition& position : positions) {
    possible.push_back(clampings_for(position, bar.pattern.hole_x_m.back(), table, angles_rad));
  }

  std::vector<IndexedPosition> indexed(positions.size());
  std::vector<bool> done(positions.size(), false);
  std::size_t clamping = 0;
  for (const Clamping* chosen = most_useful(possible, done); chosen != nullptr;
       chosen = most_useful(possible, done)) {
    for (std::size_t k = 0; k < positions.size(); ++k) {
      const Clamping* at = done[k] ? nullptr : find_same(possible[k], *chosen);
      if (at != nullptr) {
        indexed[k] = {clamping, at->swivel_rad, at->turn_rad};
        done[k] = true;
      }
    }
    ++clamping;
  }
  return indexed;
}

std::size_t clampings_of(const std::vector<IndexedPosition>& indexed) {
  std::size_t count = 0;
  for (const IndexedPosition& one : indexed) {
    count = std::max(count, one.clamping + 1);
  }
  return count;
}

}  // namespace abbe::calib::mfb
