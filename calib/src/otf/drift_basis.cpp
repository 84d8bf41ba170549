#include "otf/drift_basis.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <vector>

namespace abbe::calib::otf {
namespace {

/// Covariance of the drift at two times relative to the datum, in units of the duration.
double prior_covariance(double s, double t) {
  const double rate = s * t;
  if (s * t <= 0.0) {
    return rate;
  }
  const double least = std::min(std::abs(s), std::abs(t)),
               most = std::max(std::abs(s), std::abs(t));
  return rate + 0.5 * least * least * (3.0 * most - least);
}

}  // namespace

std::array<std::optional<DriftBasis::Share>, 2> DriftBasis::shares(double time_s) const {
  const std::vector<double>& knots = d_.knots_s;
  const auto above = std::upper_bound(knots.begin() + 1, knots.end() - 1, time_s);
  const auto right = static_cast<std::size_t>(above - knots.begin());
  const double step_s = knots[right] - knots[right - 1];
  const double to_right = std::clamp((time_s - knots[right - 1]) / step_s, 0.0, 1.0);

  std::array<std::optional<Share>, 2> found;
  const std::array weights{1.0 - to_right, to_right};
  for (std::size_t side = 0; side < 2; ++side) {
    const std::size_t knot = right - 1 + side;
    if (knot != d_.datum && weights[side] != 0.0) {
      found[side] = Share{modes_ * (knot > d_.datum ? knot - 1 : knot), weights[side]};
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

void DriftBasis::append_along(const Vector3& direction_tracker, double time_s,
                              const Vector3& p_tracker_m, std::size_t first,
                              std::vector<SparseRows::Entry>& out) const {
  const Vector3 moment = p_tracker_m.cross(direction_tracker) / d_.length_m;
  for (const auto& share : shares(time_s)) {
    for (std::size_t k = 0; share && k < modes_; ++k) {
      const double part = k < 3 ? direction_tracker(static_cast<Eigen::Index>(k))
                                : moment(static_cast<Eigen::Index>(k - 3));
      out.push_back({first + share->first + k, share->weight * part});
    }
  }
}

Eigen::MatrixXd DriftBasis::root_of_prior() const {
  const double duration_s = d_.knots_s.back() - d_.knots_s.front();
  std::vector<double> times;
  for (std::size_t i = 0; i < d_.knots_s.size(); ++i) {
    if (i != d_.datum) {
      times.push_back((d_.knots_s[i] - d_.knots_s[d_.datum]) / duration_s);
    }
  }

  const auto n = std::ssize(times);
  Eigen::MatrixXd K(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) {
      K(i, j) =
          prior_covariance(times[static_cast<std::size_t>(i)], times[static_cast<std::size_t>(j)]);
    }
  }

  return K.llt().matrixL();
}

}  // namespace abbe::calib::otf
