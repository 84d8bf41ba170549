#include "evemu/alternative_columns.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include "elementary.hpp"
#include "message.hpp"
#include "units.hpp"

namespace abbe::calib::evemu {
namespace {

/// What a displacement of the balls does to the errors seen, position by position.
class Columns {
 public:
  explicit Columns(const Observations& o) : o_(o), balls_(o.seen.front().balls.size()) {
    for (const SeenArtefact& s : o.seen) {
      first_ = std::min({first_, s.block_index[0], s.block_index[1], least(s.ball_index)});
      last_ = std::max({last_, s.block_index[0], s.block_index[1], most(s.ball_index)});
    }
    for (std::size_t b = 0; b < balls_; ++b) {
      arm_m_ = std::max(arm_m_, from_ball1_m(o.seen.front(), b).norm());
    }
  }

  [[nodiscard]] std::size_t balls() const { return balls_; }
  [[nodiscard]] double arm_m() const { return arm_m_; }
  [[nodiscard]] Eigen::MatrixXd zero(Eigen::Index columns) const {
    return Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(3 * o_.rows.size()), columns);
  }
  [[nodiscard]] static Eigen::Index row(const Columns& c, std::size_t position, std::size_t ball) {
    return static_cast<Eigen::Index>(3 * (position * c.balls_ + ball));
  }
  /// Of ball b, in the machine's directions.
  [[nodiscard]] static Vector3 from_ball1_m(const SeenArtefact& s, std::size_t b) {
    return s.ideal_m[b] - s.ideal_m.front();
  }
  /// 0 to 1 over the run, and over a position.
  [[nodiscard]] double in_run(double index) const { return (index - first_) / std::max(1.0, last_ - first_); }
  [[nodiscard]] static double in_position(const SeenArtefact& s, std::size_t b) {
    const double from = s.ball_index.front(), to = most(s.ball_index);
    return to > from ? (s.ball_index[b] - from) / (to - from) : 0.0;
  }

 private:
  static double least(const std::vector<double>& v) { return *std::min_element(v.begin(), v.end()); }
  static double most(const std::vector<double>& v) { return *std::max_element(v.begin(), v.end()); }

  const Observations& o_;
  std::size_t balls_;
  double arm_m_ = 0.0, first_ = 1e300, last_ = 0.0;
};

using Rows3 = Eigen::Matrix<double, 3, Eigen::Dynamic>;

/// A shift, and a turn about Ball1 of one arm.
Rows3 shift_and_turn(const Vector3& from_ball1_m, double arm_m) {
  Rows3 rows(3, 6);
  rows << Matrix3::Identity(), rotation_effect(from_ball1_m) / arm_m;
  return rows;
}

void single_balls(const Observations& o, const Columns& c, std::vector<Added>& all) {
  for (std::size_t p = 0; p < o.seen.size(); ++p) {
    for (std::size_t b = 0; b < c.balls(); ++b) {
      Eigen::MatrixXd C = c.zero(3);
      for (std::size_t i = 1; i < c.balls(); ++i) {
        const double share = (i == b ? -1.0 : 0.0) + (b == 0 ? 1.0 : 0.0);
        C.middleRows<3>(Columns::row(c, p, i)) = share * Matrix3::Identity();
      }
      all.push_back({Cause::Ball, p, b, std::move(C)});
    }
  }
}

void balls_of_the_file(const Observations& o, const Columns& c, std::vector<Added>& all) {
  for (std::size_t b = 0; b < c.balls(); ++b) {
    Eigen::MatrixXd C = c.zero(3);
    for (std::size_t p = 0; p < o.seen.size(); ++p) {
      for (std::size_t i = 1; i < c.balls(); ++i) {
        const double share = (i == b ? 1.0 : 0.0) - (b == 0 ? 1.0 : 0.0);
        C.middleRows<3>(Columns::row(c, p, i)) = share * o.seen[p].T_self_uni.R;
      }
    }
    all.push_back({Cause::ArrayFile, 0, b, std::move(C)});
  }
}

/// From ball b on. Between Ball1 and the next one there are the blocks.
void steps(const Observations& o, const Columns& c, std::vector<Added>& all) {
  for (std::size_t p = 0; p < o.seen.size(); ++p) {
    const SeenArtefact& s = o.seen[p];
    for (std::size_t b = 1; b + 1 < c.balls(); ++b) {
      Eigen::MatrixXd C = c.zero(6);
      for (std::size_t i = 1; i < c.balls(); ++i) {
        if (s.ball_index[i] >= s.ball_index[b]) {
          C.middleRows<3>(Columns::row(c, p, i)) = -shift_and_turn(Columns::from_ball1_m(s, i), c.arm_m());
        }
      }
      all.push_back({Cause::Moved, p, b, std::move(C)});
    }
  }
}

/// Columns of its own for every position.
void by_position(Cause cause, Eigen::Index count, const Observations& o, const Columns& c,
                 const std::function<Rows3(const SeenArtefact&, std::size_t ball)>& displaced,
                 std::vector<Added>& all) {
  Eigen::MatrixXd C = c.zero(count * std::ssize(o.seen));
  for (std::size_t p = 0; p < o.seen.size(); ++p) {
    for (std::size_t i = 1; i < c.balls(); ++i) {
      C.block(Columns::row(c, p, i), count * static_cast<Eigen::Index>(p), 3, count) =
          -displaced(o.seen[p], i);
    }
  }
  all.push_back({cause, 0, 0, std::move(C)});
}

/// A bow of the long leg upwards and sideways, of the short one upwards, a twist.
Rows3 bow(const SeenArtefact& s, std::size_t ball, double arm_m) {
  const Vector3 a = s.T_self_uni.R.transpose() * Columns::from_ball1_m(s, ball) / arm_m;
  Rows3 rows(3, 4);
  const Vector3 y = s.T_self_uni.R.col(1), z = s.T_self_uni.R.col(2);
  rows << a.x() * a.x() * z, a.x() * a.x() * y, a.y() * a.y() * z, a.x() * a.y() * z;
  return rows;
}

/// By what V = G (p - p1) turns the blocks.
Vector3 turn_of_blocks(const SeenArtefact& s, const Matrix3& G) {
  const Vector3 &n1 = s.blocks[0].normal, &n2 = s.blocks[1].normal;
  const Vector3 z = s.T_self_uni.R.col(2), y = s.T_self_uni.R.col(1);
  const auto changed = [&](const Vector3& n) -> Vector3 {
    const Vector3 d = -G.transpose() * n;
    return d - n * n.dot(d);
  };
  const Vector3 dz = changed(n1), dx = (changed(n2).cross(z) + n2.cross(dz)) / n2.cross(n1).norm();
  return z.cross(dz) + z * y.dot(dx);
}

/// The machine expands, shears and shifts at constant rates: V changes by t (G (p - p1) + v).
void drift(const Observations& o, const Columns& c, std::vector<Added>& all) {
  const std::array<std::pair<int, int>, 6> strains{{{0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}}};
  Eigen::MatrixXd C = c.zero(9);
  for (std::size_t p = 0; p < o.seen.size(); ++p) {
    const SeenArtefact& s = o.seen[p];
    for (std::size_t i = 1; i < c.balls(); ++i) {
      const Vector3 a = Columns::from_ball1_m(s, i);
      const double t = c.in_run(s.ball_index[i]) - 0.5;
      Eigen::Index k = 0;
      for (const auto& [u, v] : strains) {
        Matrix3 G = Matrix3::Zero();
        G(u, v) = 1.0 / c.arm_m();
        G(v, u) = G(u, v);
        C.block<3, 1>(Columns::row(c, p, i), k++) = t * (G * a - turn_of_blocks(s, G).cross(a));
      }
      C.block<3, 3>(Columns::row(c, p, i), k) =
          (t + 0.5 - c.in_run(s.ball_index.front())) * Matrix3::Identity();
    }
  }
  all.push_back({Cause::Drift, 0, 0, std::move(C)});
}

/// A shift that changes from ball to ball, uncorrelated over a quarter of a position.
void slow_noise(const Observations& o, const Columns& c, std::vector<Added>& all) {
  constexpr double kPer_position = 4.0;
  const auto n = static_cast<Eigen::Index>(c.balls());
  Eigen::MatrixXd C = c.zero(3 * n * std::ssize(o.seen));
  for (std::size_t p = 0; p < o.seen.size(); ++p) {
    Eigen::MatrixXd covariance(n, n);
    for (Eigen::Index i = 0; i < n; ++i) {
      for (Eigen::Index j = 0; j < n; ++j) {
        covariance(i, j) = exponential(
            -kPer_position * std::abs(Columns::in_position(o.seen[p], static_cast<std::size_t>(i)) -
                                      Columns::in_position(o.seen[p], static_cast<std::size_t>(j))));
      }
    }
    const Eigen::MatrixXd L = covariance.llt().matrixL();
    for (Eigen::Index i = 1; i < n; ++i) {
      for (Eigen::Index j = 0; j < n; ++j) {
        C.block<3, 3>(Columns::row(c, p, static_cast<std::size_t>(i)),
                      3 * (n * static_cast<Eigen::Index>(p) + j)) = (L(i, j) - L(0, j)) * Matrix3::Identity();
      }
    }
  }
  all.push_back({Cause::SlowNoise, 0, 0, std::move(C)});
}

std::string um(double m) {
  return message(m * kUmPerM, " um");
}
std::string vector_um(const Vector3& v_m) {
  return message("x ", v_m.x() * kUmPerM, ", y ", v_m.y() * kUmPerM, ", z ", v_m.z() * kUmPerM, " um");
}

/// Root mean square over positions, of the largest column.
double largest_rms(const Eigen::VectorXd& d, Eigen::Index count) {
  double most = 0.0;
  for (Eigen::Index k = 0; k < count; ++k) {
    const Eigen::VectorXd of_column = d(Eigen::seqN(k, d.size() / count, count));
    most = std::max(most, of_column.norm() / std::sqrt(static_cast<double>(of_column.size())));
  }
  return most;
}

}  // namespace

std::vector<Added> alternative_columns(const Observations& o) {
  std::vector<Added> all;
  if (o.seen.empty()) {
    return all;
  }
  const Columns c(o);
  single_balls(o, c, all);
  balls_of_the_file(o, c, all);
  steps(o, c, all);
  by_position(
      Cause::Creep, 6, o, c,
      [&](const SeenArtefact& s, std::size_t b) -> Rows3 {
        return Columns::in_position(s, b) * shift_and_turn(Columns::from_ball1_m(s, b), c.arm_m());
      },
      all);
  by_position(
      Cause::Bent, 4, o, c, [&](const SeenArtefact& s, std::size_t b) { return bow(s, b, c.arm_m()); }, all);
  drift(o, c, all);
  slow_noise(o, c, all);
  return all;
}

std::string text_of(const Added& a, const Eigen::VectorXd& d, const Observations& o) {
  const int position = o.seen[a.seen].position;
  const std::size_t ball = a.feature + 1;
  switch (a.cause) {
    case Cause::Ball:
      return message(
          "position ", position, ", ball ", ball, ": ", um(d.norm()), " off its place in the array (",
          vector_um(d),
          "): dirt, a loose seat, or the array moved there; clean it and touch the position again");
    case Cause::ArrayFile:
      return message("the calibrator file's place of ball ", ball, " is off by ", um(d.norm()), " (",
                     vector_um(d),
                     " along its axes), alike at all positions: wrong file or entry, or the ball "
                     "was displaced since; calibrate the array anew");
    case Cause::Moved:
      return message("position ", position, ": the array moved before ball ", ball, " was touched, by ",
                     um(d.head<3>().norm()), " and ", um(d.tail<3>().norm()),
                     " of turn at its end; clamp it and touch the position again");
    case Cause::Creep:
      return message("the array creeps after clamping: it moves by up to ", um(largest_rms(d, 6)),
                     " (rms) in a position; wait after clamping, or clamp it better");
    case Cause::Bent:
      return message("the array is bent anew at every position, by ", um(largest_rms(d, 4)),
                     " (rms): clamping, or its supports");
    case Cause::Drift:
      return message("the machine drifts: within the session it expands or shears by ",
                     um(d.head<6>().norm()), " over the array and shifts by ", um(d.tail<3>().norm()),
                     "; let it warm up");
    case Cause::SlowNoise:
      return message("slow noise: within positions all touches shift by ",
                     um(std::sqrt(d.squaredNorm() / static_cast<double>(d.size()))),
                     " (rms): vibration, temperature, or a probe that does not repeat");
    default:
      return {};
  }
}

}  // namespace abbe::calib::evemu
