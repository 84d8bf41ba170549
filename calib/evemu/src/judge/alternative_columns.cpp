#include "judge/alternative_columns.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <utility>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"

namespace abbe::calib::evemu {
namespace {

using Rows3 = Eigen::Matrix<double, 3, Eigen::Dynamic>;

/// Vector from Ball1 to ball b in machine directions.
Vector3 from_ball1_m(const TouchedArtefact& s, std::size_t b) {
  return s.ideal_m[b] - s.ideal_m.front();
}

/// Smallest and largest time index (TouchedArtefact::ball_index, block_index) of the balls and
/// blocks of these positions.
std::pair<double, double> touched_between(std::span<const TouchedArtefact> seen) {
  std::pair<double, double> between{seen.front().ball_index.front(),
                                    seen.front().ball_index.front()};
  const auto widen = [&](double index) {
    between = {std::min(between.first, index), std::max(between.second, index)};
  };
  for (const TouchedArtefact& s : seen) {
    std::for_each(s.ball_index.begin(), s.ball_index.end(), widen);
    std::for_each(s.block_index.begin(), s.block_index.end(), widen);
  }
  return between;
}

double share_of(const std::pair<double, double>& between, double index) {
  return (index - between.first) / std::max(1.0, between.second - between.first);
}

/// Displacement of a ball for four shapes of a bent array, one column each: the long leg of the L
/// bent upwards, the long leg bent sideways, the short leg bent upwards, a twist.
Rows3 bow(const TouchedArtefact& s, std::size_t ball, double arm_m) {
  const Vector3 a = s.T_self_uni.R.transpose() * from_ball1_m(s, ball) / arm_m;
  Rows3 rows(3, 4);
  const Vector3 y = s.T_self_uni.R.col(1), z = s.T_self_uni.R.col(2);
  rows << a.x() * a.x() * z, a.x() * a.x() * y, a.y() * a.y() * z, a.x() * a.y() * z;
  return rows;
}

/// Rotation of the uniform frame, computed from the touched blocks, if points p move by G (p - p1)
/// during the touches. G: displacement gradient, p1: place of Ball1, share[b]: fraction of the
/// motion that is complete when block b is touched.
Vector3 turn_of_blocks(const TouchedArtefact& s, const Matrix3& G,
                       const std::array<double, 2>& share) {
  const Vector3 &n1 = s.blocks[0].normal, &n2 = s.blocks[1].normal;
  const Vector3 z = s.T_self_uni.R.col(2), y = s.T_self_uni.R.col(1);
  const auto changed = [&](const Vector3& n, double by) -> Vector3 {
    const Vector3 d = -by * (G.transpose() * n);
    return d - n * n.dot(d);
  };
  const Vector3 dz = changed(n1, share[0]);
  const Vector3 dx = (changed(n2, share[1]).cross(z) + n2.cross(dz)) / n2.cross(n1).norm();
  return z.cross(dz) + z * y.dot(dx);
}

/// Fraction of a motion that is complete at a time, given as index among the touches.
using DoneShare = std::function<double(double index)>;

/// Observed displacement of a ball by the motion G (p - p1) of turn_of_blocks(): its own
/// displacement minus the effect of the rotation of the uniform frame.
Vector3 seen_of(const TouchedArtefact& s, std::size_t ball, const Matrix3& G,
                const DoneShare& share) {
  const Vector3 a = from_ball1_m(s, ball);
  const Vector3 blocks = turn_of_blocks(s, G, {share(s.block_index[0]), share(s.block_index[1])});
  return share(s.ball_index[ball]) * (G * a) - blocks.cross(a);
}

/// Matrix from a translation during the touches to the displacement of a ball relative to Ball1,
/// which was touched at another time.
Matrix3 seen_shift(const TouchedArtefact& s, std::size_t ball, const DoneShare& share) {
  return (share(s.ball_index[ball]) - share(s.ball_index.front())) * Matrix3::Identity();
}

/// Observed displacement of a ball: three columns for unit translations of the array, then three
/// for rotations about Ball1 that displace a point at the distance `arm_m` by one unit.
Rows3 shifted_and_turned(const TouchedArtefact& s, std::size_t ball, double arm_m,
                         const DoneShare& share) {
  Rows3 rows(3, 6);
  rows.leftCols<3>() = seen_shift(s, ball, share);
  for (Eigen::Index k = 0; k < 3; ++k) {
    const Matrix3 turn = -rotation_effect(Vector3::Unit(k) / arm_m);
    rows.col(3 + k) = seen_of(s, ball, turn, share);
  }
  return rows;
}

/// True if another feature is touched before this ball and another one after it. A step at the
/// first or last feature cannot be distinguished from a single displaced ball.
bool between_others(const TouchedArtefact& s, std::size_t ball) {
  const auto [first, last] = touched_between({&s, 1});
  return s.ball_index[ball] > first && s.ball_index[ball] < last;
}

std::string um(double m) {
  return message(m * kUmPerM, " um");
}
std::string vector_um(const Vector3& v_m) {
  return message("x ", v_m.x() * kUmPerM, ", y ", v_m.y() * kUmPerM, ", z ", v_m.z() * kUmPerM,
                 " um");
}

Eigen::Index columns_by_position(Cause cause) {
  return cause == Cause::Bent ? 4 : 6;
}

/// `d` has `count` coefficients for each position. For each of the `count` coefficients the root
/// mean square over the positions is formed; the largest of these is returned.
double largest_rms(const Eigen::VectorXd& d, Eigen::Index count) {
  double most = 0.0;
  for (Eigen::Index k = 0; k < count; ++k) {
    const Eigen::VectorXd of_column = d(Eigen::seqN(k, d.size() / count, count));
    most = std::max(most, of_column.norm() / std::sqrt(static_cast<double>(of_column.size())));
  }
  return most;
}

}  // namespace

AlternativeColumns::AlternativeColumns(const Observations& o) : o_(o) {
  for (std::size_t b = 0; !o.seen.empty() && b < o.seen.front().balls.size(); ++b) {
    arm_m_ = std::max(arm_m_, from_ball1_m(o.seen.front(), b).norm());
  }
}

std::vector<std::vector<Added>> AlternativeColumns::families() const {
  if (o_.seen.empty()) {
    return {};
  }

  std::vector<Added> balls, of_the_file, steps;
  const std::size_t count = o_.seen.front().balls.size();
  for (std::size_t b = 0; b < count; ++b) {
    of_the_file.push_back({Cause::ArrayFile, 0, b});
    for (std::size_t p = 0; p < o_.seen.size(); ++p) {
      balls.push_back({Cause::Ball, p, b});
      if (between_others(o_.seen[p], b)) {
        steps.push_back({Cause::Moved, p, b});
      }
    }
  }

  std::vector<std::vector<Added>> all{balls, of_the_file};
  if (!steps.empty()) {
    all.push_back(steps);
  }

  for (const Cause cause : {Cause::Creep, Cause::Bent, Cause::Drift}) {
    all.push_back({Added{cause, 0, 0}});
  }

  return all;
}

/// Calls `block` for the rows of every ball except Ball1, whose rows stay zero.
template <class Block>
Eigen::MatrixXd AlternativeColumns::filled(Eigen::Index columns, const Block& block) const {
  const std::size_t balls = o_.seen.front().balls.size();
  Eigen::MatrixXd C = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(3 * o_.rows.size()), columns);
  for (std::size_t p = 0; p < o_.seen.size(); ++p) {
    for (std::size_t i = 1; i < balls; ++i) {
      block(C.middleRows<3>(static_cast<Eigen::Index>(3 * (p * balls + i))), p, i);
    }
  }
  return C;
}

Eigen::MatrixXd AlternativeColumns::of_balls(const Added& a) const {
  const auto share = [&](std::size_t i) {
    return (i == a.feature ? 1.0 : 0.0) - (a.feature == 0 ? 1.0 : 0.0);
  };
  return filled(3, [&](auto rows, std::size_t p, std::size_t i) {
    if (a.cause == Cause::ArrayFile) {
      rows = share(i) * o_.seen[p].T_self_uni.R;
    } else if (p == a.seen) {
      rows = -share(i) * Matrix3::Identity();
    }
  });
}

Eigen::MatrixXd AlternativeColumns::of_step(const Added& a) const {
  const double at = o_.seen[a.seen].ball_index[a.feature];
  return filled(6, [&](auto rows, std::size_t p, std::size_t i) {
    if (p == a.seen) {
      rows = -shifted_and_turned(o_.seen[p], i, arm_m_,
                                 [&](double index) { return index >= at ? 1.0 : 0.0; });
    }
  });
}

/// Columns of an alternative that has its own coefficients at every position.
Eigen::MatrixXd AlternativeColumns::by_position(Cause cause) const {
  const Eigen::Index count = columns_by_position(cause);
  return filled(count * std::ssize(o_.seen), [&](auto rows, std::size_t p, std::size_t i) {
    const TouchedArtefact& s = o_.seen[p];
    auto here = rows.middleCols(count * static_cast<Eigen::Index>(p), count);
    if (cause == Cause::Bent) {
      here = -bow(s, i, arm_m_);
    } else {
      const auto between = touched_between({&s, 1});
      here =
          -shifted_and_turned(s, i, arm_m_, [&](double index) { return share_of(between, index); });
    }
  });
}

/// Columns of Cause::Drift. The machine expands, shears and shifts at constant rates: V changes by
/// t (G (p - p1) + v). t: time as fraction of the session, G: symmetric strain, p1: place of Ball1,
/// v: translation.
Eigen::MatrixXd AlternativeColumns::of_drift() const {
  const std::array<std::pair<int, int>, 6> strains{
      {{0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}}};
  const auto between = touched_between(o_.seen);
  const auto share = [&](double index) { return share_of(between, index) - 0.5; };

  return filled(9, [&](auto rows, std::size_t p, std::size_t i) {
    Eigen::Index k = 0;
    for (const auto& strain : strains) {
      Matrix3 G = Matrix3::Zero();
      G(strain.first, strain.second) = 1.0 / arm_m_;
      G(strain.second, strain.first) = 1.0 / arm_m_;
      rows.col(k++) = seen_of(o_.seen[p], i, G, share);
    }
    rows.template rightCols<3>() = seen_shift(o_.seen[p], i, share);
  });
}

Eigen::MatrixXd AlternativeColumns::of(const Added& a) const {
  switch (a.cause) {
    case Cause::Ball:
    case Cause::ArrayFile:
      return of_balls(a);
    case Cause::Moved:
      return of_step(a);
    case Cause::Drift:
      return of_drift();
    default:
      return by_position(a.cause);
  }
}

std::string where(const Added& a, const Observations& o) {
  if (a.cause == Cause::ArrayFile) {
    return message(", ball ", a.feature + 1);
  }
  const bool placed = a.cause == Cause::Ball || a.cause == Cause::Moved;
  return placed ? message(", position ", o.seen[a.seen].position, ", ball ", a.feature + 1)
                : std::string();
}

std::string text_of(const Added& a, const Eigen::VectorXd& d, const Observations& o) {
  const int position = o.seen[a.seen].position;
  const std::size_t ball = a.feature + 1;
  switch (a.cause) {
    case Cause::Ball:
      return message(
          "position ", position, ", ball ", ball, ": the ball is displaced by ", um(d.norm()),
          " from its place in the array (", vector_um(d),
          "): dirt, a loose seat, or the array moved; clean it and touch the position again");
    case Cause::ArrayFile:
      return message("the position of ball ", ball, " in the calibrator file is wrong by ",
                     um(d.norm()), " (", vector_um(d),
                     " along the axes of the file), the same at all positions: wrong file or "
                     "entry, or the ball was displaced after the array's calibration; calibrate "
                     "the array again");
    case Cause::Moved:
      return message("position ", position, ": the array moved before ball ", ball,
                     " was touched: translation ", um(d.head<3>().norm()), ", rotation ",
                     um(d.tail<3>().norm()),
                     " at its far end; clamp it and touch the position again");
    case Cause::Creep:
      return message("the array creeps after clamping: it moves by up to ",
                     um(largest_rms(d, columns_by_position(a.cause))),
                     " (rms) within a position; wait after clamping, or clamp it better");
    case Cause::Bent:
      return message("the array is bent differently at every position, by ",
                     um(largest_rms(d, columns_by_position(a.cause))),
                     " (rms); check its clamping and supports");
    case Cause::Drift:
      return message("the machine drifts: during the session it expands or shears by ",
                     um(d.head<6>().norm()), " over the array and shifts by ",
                     um(d.tail<3>().norm()), "; wait until the machine has warmed up");
    default:
      return {};
  }
}

}  // namespace abbe::calib::evemu
