#include "abbe/calib/otf/solve/other_beams.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <vector>

#include "abbe/calib/internal/otf/observe/row_residuals.hpp"

namespace abbe::calib::otf {
namespace {

/// Difference of the residuals of two consecutive rows of one component.
struct Difference {
  double d_m = 0.0;
  Vector3 component = Vector3::UnitX();
  Vector3 stated_beam = Vector3::UnitX();
};

std::vector<Difference> differences(const Observations& o, std::span<const double> residual_m,
                                    const Vector3& tracker_m) {
  std::vector<Difference> all;
  std::array<std::optional<std::size_t>, 2> before;  // previous row of each component
  for (std::size_t i = 0; i < o.rows.size(); ++i) {
    const Observation& row = o.rows[i];
    if (row.component >= before.size()) {
      continue;
    }
    auto& last = before[row.component];
    if (last && o.rows[*last].leg == row.leg && o.rows[*last].segment + 1 == row.segment) {
      const Vector3 beam_m = row.axis_position_m + o.target_offset_m - tracker_m;
      all.push_back({residual_m[i] - residual_m[*last], row.direction, beam_m.normalized()});
    }
    last = i;
  }
  return all;
}

using Vector6d = Eigen::Matrix<double, 6, 1>;

/// The row with c^T S c = of(c) . (Sxx, Syy, Szz, Syz, Szx, Sxy).
Vector6d of(const Vector3& c) {
  Vector6d row;
  row << c.cwiseAbs2(), 2.0 * c.y() * c.z(), 2.0 * c.z() * c.x(), 2.0 * c.x() * c.y();
  return row;
}

/// Estimates S in m^2; nullopt if the components do not determine it. The square of a difference
/// has a standard deviation of sqrt(2) times its expectation.
std::optional<Matrix3> covariance_of(std::span<const Difference> all) {
  constexpr int kRounds = 10;
  constexpr double kLeast = 0.01, kDetermined = 1e-3;  // relative limits
  double mean_m2 = 0.0;
  for (const Difference& d : all) {
    mean_m2 += d.d_m * d.d_m / static_cast<double>(all.size());
  }

  Vector6d s;
  s << mean_m2, mean_m2, mean_m2, 0.0, 0.0, 0.0;
  for (int round = 0; round < kRounds; ++round) {
    Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
    Vector6d right = Vector6d::Zero();
    for (const Difference& d : all) {
      const Vector6d row = of(d.component);
      const double expected = std::max(row.dot(s) / mean_m2, kLeast);
      normal += row * row.transpose() / (expected * expected);
      right += row * (d.d_m * d.d_m / mean_m2) / (expected * expected);
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>> eigen(normal);
    if (!(eigen.eigenvalues()(0) > kDetermined * eigen.eigenvalues()(5))) {
      return std::nullopt;
    }
    s = mean_m2 * normal.ldlt().solve(right);
  }

  Matrix3 S;
  S << s(0), s(5), s(4), s(5), s(1), s(3), s(4), s(3), s(2);
  return S;
}

}  // namespace

std::optional<OtherBeams> find_other_beams(const Observations& o, const Solution& solution) {
  constexpr std::size_t kLeastRows = 200;
  // Limits of ratios of the three variances of S. kAlike: of the two largest, which must be equal.
  // kSmaller: of the smallest to them. The latter ratio has a relative standard deviation of about
  // 3 / sqrt(rows).
  constexpr double kAlike = 0.5, kSmaller = 0.6, kSure = 5.0;
  constexpr double kStated = 0.5;  // mean square of the cosine to the stated beams
  if (o.mode != Mode::OnTheFly) {
    return std::nullopt;
  }
  const RigidTransform& T = solution.T_machine_tracker;
  const std::vector<Difference> all =
      differences(o, residuals_m(without_run_effects(o, solution), solution.adjustment.U), T.t_m);
  const std::optional<Matrix3> S = all.size() < kLeastRows ? std::nullopt : covariance_of(all);
  if (!S) {
    return std::nullopt;
  }

  const Eigen::SelfAdjointEigenSolver<Matrix3> eigen(*S);
  const Vector3 variances = eigen.eigenvalues().cwiseMax(0.0);
  const Vector3 direction = eigen.eigenvectors().col(0);
  const double smaller =
      std::min(kSmaller, 1.0 - kSure * 3.0 / std::sqrt(static_cast<double>(all.size())));
  double cosine2 = 0.0;
  for (const Difference& d : all) {
    const double cosine = d.stated_beam.dot(direction);
    cosine2 += cosine * cosine / static_cast<double>(all.size());
  }
  if (variances(1) < kAlike * variances(2) || variances(0) > smaller * variances(1) ||
      cosine2 > kStated) {
    return std::nullopt;
  }
  return OtherBeams{.direction = T.R.transpose() * direction,
                    .angle_rad = std::acos(std::sqrt(cosine2)),
                    .along_m = std::sqrt(variances(0)),
                    .across_m = std::sqrt(0.5 * (variances(1) + variances(2)))};
}

}  // namespace abbe::calib::otf
