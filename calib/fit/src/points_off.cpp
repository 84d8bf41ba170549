#include "abbe/calib/fit/points_off.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>

#include "abbe/calib/internal/statistics/median.hpp"

namespace abbe::calib::fit {
namespace {

constexpr double kMostRatio = 10.0;
constexpr std::size_t kFewestThatFit = 5;  // give 9 degrees of freedom
constexpr std::size_t kMostOff = 20;       // limits the computing time

constexpr double kResolution_m = 1e-9;  // below the resolution of any instrument: rounding in a
                                        // file

using Indices = std::vector<std::size_t>;
using NormalMatrix = Eigen::Matrix<double, 6, 6>;
using MotionColumns = Eigen::Matrix<double, 3, 6>;

std::vector<Vector3> selected(std::span<const Vector3> all, const Indices& indices) {
  std::vector<Vector3> out;
  out.reserve(indices.size());
  for (const std::size_t i : indices) {
    out.push_back(all[i]);
  }
  return out;
}

Vector3 median_of(std::span<const Vector3> points) {
  Vector3 centre;
  for (Eigen::Index a = 0; a < 3; ++a) {
    std::vector<double> values;
    for (const Vector3& p : points) {
      values.push_back(p(a));
    }
    centre(a) = median(values);
  }
  return centre;
}

MotionColumns columns_at(const Vector3& lever_m) {
  MotionColumns J;
  J << Matrix3::Identity(), rotation_effect(lever_m);
  return J;
}

/// The rigid motion that fits the points with the indices `rest`, with its statistics.
struct MotionOfRest {
  RigidTransform T;
  Vector3 centre_m = Vector3::Zero();
  NormalMatrix inverse_normal = NormalMatrix::Zero();
  double u_m = 0.0;  ///< standard deviation of a coordinate

  [[nodiscard]] double limit_m(const Vector3& wanted_m) const {
    const MotionColumns J = columns_at(wanted_m - centre_m);
    return kMostRatio * u_m * std::sqrt(3.0 + (J * inverse_normal * J.transpose()).trace());
  }
};

std::optional<MotionOfRest> motion_of(std::span<const Vector3> measured_m,
                                      std::span<const Vector3> wanted_m, const Indices& rest) {
  const auto from = selected(measured_m, rest), to = selected(wanted_m, rest);
  const auto T = fit_rigid(from, to);
  if (!T) {
    return std::nullopt;
  }
  MotionOfRest motion{.T = *T, .centre_m = median_of(to)};
  NormalMatrix N = NormalMatrix::Zero();
  double squares = 0.0;
  for (std::size_t i = 0; i < to.size(); ++i) {
    const MotionColumns J = columns_at(to[i] - motion.centre_m);
    N.noalias() += J.transpose() * J;
    squares += (*T * from[i] - to[i]).squaredNorm();
  }
  motion.inverse_normal = N.ldlt().solve(NormalMatrix::Identity());
  motion.u_m =
      std::max(std::sqrt(squares / (3.0 * static_cast<double>(to.size()) - 6.0)), kResolution_m);
  return motion;
}

/// The point of `rest` with the largest residual. If the points cannot be fitted, because one is so
/// far away that the others coincide numerically: the point farthest from their median.
std::size_t worst_of(std::span<const Vector3> measured_m, std::span<const Vector3> wanted_m,
                     const Indices& rest) {
  const auto from = selected(measured_m, rest), to = selected(wanted_m, rest);
  const auto T = fit_rigid(from, to);
  const Vector3 middle = T ? Vector3(Vector3::Zero()) : median_of(from);
  std::size_t worst = 0;
  double largest = -1.0;
  for (std::size_t i = 0; i < rest.size(); ++i) {
    const double size = (T ? Vector3(*T * from[i] - to[i]) : Vector3(from[i] - middle)).norm();
    if (size > largest) {
      largest = size;
      worst = i;
    }
  }
  return worst;
}

double rms_of(std::span<const Vector3> measured_m, std::span<const Vector3> wanted_m,
              const Indices& rest, const RigidTransform& T) {
  double squares = 0.0;
  for (const std::size_t i : rest) {
    squares += (T * measured_m[i] - wanted_m[i]).squaredNorm();
  }
  return std::sqrt(squares / static_cast<double>(rest.size()));
}

/// Moves the points of `suspects` that fit the motion back to `rest`.
void keep_what_fits(const MotionOfRest& motion, std::span<const Vector3> measured_m,
                    std::span<const Vector3> wanted_m, double least_m, Indices& rest,
                    Indices& suspects) {
  const auto fits = [&](std::size_t i) {
    // A limit of NaN means that the points do not determine the motion. The point then counts as
    // fitting.
    const double limit_m = std::max(motion.limit_m(wanted_m[i]), least_m);
    return !((motion.T * measured_m[i] - wanted_m[i]).norm() > limit_m);
  };
  std::copy_if(suspects.begin(), suspects.end(), std::back_inserter(rest), fits);
  std::erase_if(suspects, fits);
  std::sort(rest.begin(), rest.end());
  std::sort(suspects.begin(), suspects.end());
}

}  // namespace

PointsOff points_off(std::span<const Vector3> measured_m, std::span<const Vector3> wanted_m,
                     double least_m) {
  const std::size_t n = measured_m.size();
  if (n <= kFewestThatFit) {
    return {};
  }
  const std::size_t most =
      std::min({std::max<std::size_t>(1, n / 5), n - kFewestThatFit, kMostOff});
  Indices rest(n), suspects;
  for (std::size_t i = 0; i < n; ++i) {
    rest[i] = i;
  }
  for (std::size_t k = 0; k < most; ++k) {
    const auto worst = static_cast<std::ptrdiff_t>(worst_of(measured_m, wanted_m, rest));
    suspects.push_back(rest[static_cast<std::size_t>(worst)]);
    rest.erase(rest.begin() + worst);
  }

  // The fit is repeated once with the points that were moved back to `rest`.
  for (int pass = 0; pass < 2; ++pass) {
    const auto motion = motion_of(measured_m, wanted_m, rest);
    if (!motion) {
      return {};
    }
    keep_what_fits(*motion, measured_m, wanted_m, least_m, rest, suspects);
  }
  const auto T = fit_rigid(selected(measured_m, rest), selected(wanted_m, rest));
  if (!T || suspects.empty()) {
    return {};
  }

  PointsOff off{{}, rms_of(measured_m, wanted_m, rest, *T)};
  for (const std::size_t i : suspects) {
    off.points.push_back({i, (*T * measured_m[i] - wanted_m[i]).norm()});
  }
  return off;
}

}  // namespace abbe::calib::fit
