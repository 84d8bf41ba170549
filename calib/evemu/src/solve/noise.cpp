#include "abbe/calib/evemu/solve/noise.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "abbe/calib/internal/statistics/elementary.hpp"

namespace abbe::calib::evemu {
namespace {

constexpr double kBall1Variance = 1e-4;  // in units of s^2; keeps the covariance regular

/// Applies `act` to the rows of all balls of a position, separately for each position and each
/// component.
template <class Act>
Eigen::MatrixXd by_position(const Observations& o, const Eigen::MatrixXd& rows, const Act& act) {
  Eigen::MatrixXd result(rows.rows(), rows.cols());
  for (const PositionRows& p : position_rows(o)) {
    const Eigen::LLT<Eigen::MatrixXd> llt(ball_covariance(o, p));
    const auto count = static_cast<Eigen::Index>(p.count);
    for (Eigen::Index c = 0; c < 3; ++c) {
      const auto at = Eigen::seqN(3 * static_cast<Eigen::Index>(p.first) + c, count, 3);
      result(at, Eigen::all) = act(llt, Eigen::MatrixXd(rows(at, Eigen::all)));
    }
  }
  return result;
}

/// Matrix with the elements k_ij - k_i1 - k_1j + k_11 (noise.hpp), i, j: balls of a position.
Eigen::MatrixXd slow_covariance(const TouchedArtefact& seen) {
  const Eigen::MatrixXd k = slow_correlation(seen);
  Eigen::MatrixXd C(k.rows(), k.cols());
  for (Eigen::Index i = 0; i < C.rows(); ++i) {
    for (Eigen::Index j = 0; j < C.cols(); ++j) {
      C(i, j) = k(i, j) - k(i, 0) - k(0, j) + 1.0;
    }
  }
  return C;
}

}  // namespace

const TouchedArtefact* touched_at(const Observations& o, int position) {
  const auto seen = std::find_if(o.seen.begin(), o.seen.end(),
                                 [&](const TouchedArtefact& s) { return s.position == position; });
  return seen == o.seen.end() ? nullptr : &*seen;
}

std::vector<double> times_in_position(const TouchedArtefact& s) {
  double first = std::min(s.block_index[0], s.block_index[1]);
  double last = std::max(s.block_index[0], s.block_index[1]);
  for (const double index : s.ball_index) {
    first = std::min(first, index), last = std::max(last, index);
  }
  std::vector<double> t;
  for (const double index : s.ball_index) {
    t.push_back(last > first ? (index - first) / (last - first) : 0.0);
  }
  return t;
}

Eigen::MatrixXd slow_correlation(const TouchedArtefact& seen) {
  constexpr double kPerPosition = 4.0;  // touching one position takes 4 correlation times
  const std::vector<double> t = times_in_position(seen);
  Eigen::MatrixXd k(std::ssize(t), std::ssize(t));
  for (Eigen::Index i = 0; i < k.rows(); ++i) {
    for (Eigen::Index j = 0; j < k.cols(); ++j) {
      k(i, j) = exponential(-kPerPosition * std::abs(t[static_cast<std::size_t>(i)] -
                                                     t[static_cast<std::size_t>(j)]));
    }
  }
  return k;
}

double log_det_of_noise(const Observations& o) {
  double sum = 0.0;
  for (const PositionRows& p : position_rows(o)) {
    const Eigen::MatrixXd L = ball_covariance(o, p).llt().matrixL();
    const auto ball1 = static_cast<Eigen::Index>(p.ball1 - p.first);
    sum += 3.0 *
           (L.diagonal().unaryExpr(&natural_logarithm).sum() - natural_logarithm(L(ball1, ball1)));
  }
  return sum;
}

std::vector<PositionRows> position_rows(const Observations& o) {
  std::vector<PositionRows> found;
  for (std::size_t i = 0; i < o.rows.size(); ++i) {
    if (found.empty() || found.back().position != o.rows[i].position) {
      found.push_back({o.rows[i].position, i, 0, i});
    }
    ++found.back().count;
    if (o.rows[i].ball == 1) {
      found.back().ball1 = i;
    }
  }
  return found;
}

Eigen::MatrixXd ball_covariance(const Observations& o, const PositionRows& p) {
  const auto n = static_cast<Eigen::Index>(p.count),
             first = static_cast<Eigen::Index>(p.ball1 - p.first);
  Eigen::MatrixXd C = Eigen::MatrixXd::Ones(n, n) + Eigen::MatrixXd::Identity(n, n);
  const TouchedArtefact* seen = touched_at(o, p.position);
  if (o.slow_noise > 0.0 && seen != nullptr) {
    C += o.slow_noise * o.slow_noise * slow_covariance(*seen);
  }
  C.row(first).setZero();
  C.col(first).setZero();
  C(first, first) = kBall1Variance;
  return C;
}

Eigen::MatrixXd whitened(const Observations& o, const Eigen::MatrixXd& rows) {
  return by_position(o, rows, [](const Eigen::LLT<Eigen::MatrixXd>& llt, const Eigen::MatrixXd& m) {
    return Eigen::MatrixXd(llt.matrixL().solve(m));
  });
}

Eigen::MatrixXd times_noise_root(const Observations& o, const Eigen::MatrixXd& rows) {
  return by_position(o, rows, [](const Eigen::LLT<Eigen::MatrixXd>& llt, const Eigen::MatrixXd& m) {
    return Eigen::MatrixXd(llt.matrixU() * m);
  });
}

Eigen::MatrixXd coloured(const Observations& o, const Eigen::MatrixXd& rows) {
  return by_position(o, rows, [](const Eigen::LLT<Eigen::MatrixXd>& llt, const Eigen::MatrixXd& m) {
    return Eigen::MatrixXd(llt.matrixL() * m);
  });
}

Eigen::MatrixXd pose_rotation_rows(const Observations& o) {
  const std::vector<PositionRows> positions = position_rows(o);
  Eigen::MatrixXd S = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(3 * o.rows.size()),
                                            static_cast<Eigen::Index>(3 * positions.size()));
  for (std::size_t p = 0; p < positions.size(); ++p) {
    const Vector3& ball1_m = o.rows[positions[p].ball1].reading_m;
    for (std::size_t i = positions[p].first; i < positions[p].first + positions[p].count; ++i) {
      S.block<3, 3>(static_cast<Eigen::Index>(3 * i), static_cast<Eigen::Index>(3 * p)) =
          -rotation_effect(o.rows[i].reading_m - ball1_m);
    }
  }
  return S;
}

}  // namespace abbe::calib::evemu
