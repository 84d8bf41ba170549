#include "nests/drift_basis.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "abbe/calib/internal/statistics/elementary.hpp"

namespace abbe::calib::otf {
namespace {

/// Covariance of the drift at the times s and t, measured from the first visit in units of the
/// duration of the run.
double prior_covariance(double s, double t, DriftCourse course) {
  const double rate = s * t;
  const bool curved = course == DriftCourse::Curved;
  const double of_polynomial = curved ? rate + rate * rate : rate;
  if (rate <= 0.0) {
    return of_polynomial;
  }

  const double m = std::min(std::abs(s), std::abs(t)), M = std::max(std::abs(s), std::abs(t));
  if (curved) {
    return of_polynomial + m * m * m * (10.0 * M * M - 5.0 * M * m + m * m) / 6.0;
  }
  const double walk = walk_of(course);
  return of_polynomial + 0.5 * m * m * (3.0 * M - m) + walk * walk * m;
}

}  // namespace

double walk_of(DriftCourse course) {
  switch (course) {
    case DriftCourse::Curved:
    case DriftCourse::Smooth:
      return 0.0;
    case DriftCourse::SmallWalk:
      return 0.125;
    case DriftCourse::Walk:
      return 1.0;
  }
  return 0.0;
}

DriftBasis::Interval DriftBasis::interval_of(double time_s) const {
  const std::vector<double>& knots = d_.knots_s;
  const auto above = std::upper_bound(knots.begin() + 1, knots.end() - 1, time_s);
  const auto right = static_cast<std::size_t>(above - knots.begin());
  const double step_s = knots[right] - knots[right - 1];
  return {right - 1, std::clamp((time_s - knots[right - 1]) / step_s, 0.0, 1.0)};
}

std::array<std::optional<DriftBasis::Share>, 2> DriftBasis::shares(double time_s) const {
  const Interval interval = interval_of(time_s);
  std::array<std::optional<Share>, 2> found;
  const std::array weights{1.0 - interval.tau, interval.tau};
  for (std::size_t side = 0; side < 2; ++side) {
    const std::size_t knot = interval.before + side;
    if (knot != d_.zero && weights[side] != 0.0) {
      found[side] = Share{modes_ * (knot > d_.zero ? knot - 1 : knot), weights[side]};
    }
  }
  return found;
}

Eigen::MatrixXd DriftBasis::dp_dc(double time_s, const Vector3& p_tracker_m) const {
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(3, static_cast<Eigen::Index>(size()));
  const Matrix3 rotation = rotation_effect(p_tracker_m) / d_.length_m;
  for (const auto& share : shares(time_s)) {
    if (share) {
      const auto first = static_cast<Eigen::Index>(share->first);
      H.block<3, 3>(0, first) = share->weight * Matrix3::Identity();
      if (d_.rotates) {
        H.block<3, 3>(0, first + 3) = share->weight * rotation;
      }
    }
  }
  return H;
}

double DriftBasis::along(std::size_t k, const Vector3& direction_tracker,
                         const Vector3& p_tracker_m) const {
  if (k < 3) {
    return direction_tracker(static_cast<Eigen::Index>(k));
  }
  return p_tracker_m.cross(direction_tracker)(static_cast<Eigen::Index>(k - 3)) / d_.length_m;
}

void DriftBasis::append_along(const Vector3& direction_tracker, double time_s,
                              const Vector3& p_tracker_m, std::size_t first,
                              std::vector<SparseRows::Entry>& out) const {
  for (const auto& share : shares(time_s)) {
    for (std::size_t k = 0; share && k < modes_; ++k) {
      out.push_back(
          {first + share->first + k, share->weight * along(k, direction_tracker, p_tracker_m)});
    }
  }
}

void DriftBasis::append_between_knots(const Vector3& direction_tracker, double time_s,
                                      const Vector3& p_tracker_m, std::size_t first,
                                      std::vector<SparseRows::Entry>& out) const {
  const auto [before, tau] = interval_of(time_s);
  const double duration_s = d_.knots_s.back() - d_.knots_s.front();
  const double step_s = d_.knots_s[before + 1] - d_.knots_s[before];

  for (std::size_t j = 1; j <= kSines; ++j) {
    const double phase = static_cast<double>(j) * std::numbers::pi;
    const double value = std::sqrt(2.0 * step_s / duration_s) * sin_cos(phase * tau).sin / phase;
    const std::size_t at = first + modes_ * (kSines * before + j - 1);
    for (std::size_t k = 0; k < modes_; ++k) {
      out.push_back({at + k, value * along(k, direction_tracker, p_tracker_m)});
    }
  }
}

Eigen::MatrixXd DriftBasis::root_of_prior(DriftCourse course) const {
  const double duration_s = d_.knots_s.back() - d_.knots_s.front();
  std::vector<double> times;
  for (std::size_t i = 0; i < d_.knots_s.size(); ++i) {
    if (i != d_.zero) {
      times.push_back((d_.knots_s[i] - d_.knots_s[d_.zero]) / duration_s);
    }
  }

  const auto n = std::ssize(times);
  Eigen::MatrixXd K(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) {
      K(i, j) = prior_covariance(times[static_cast<std::size_t>(i)],
                                 times[static_cast<std::size_t>(j)], course);
    }
  }

  return K.llt().matrixL();
}

}  // namespace abbe::calib::otf
