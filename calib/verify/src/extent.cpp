#include "extent.hpp"

#include <Eigen/Eigenvalues>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"

namespace abbe::calib::verify {

Result<Extent> extent_of(std::span<const Vector3> points_m) {
  constexpr std::size_t kTetrahedron = 4;
  constexpr double kThin = 1e-3;
  if (points_m.size() < kTetrahedron) {
    return failure(ErrorCode::TooFewObservations,
                   message("volume of ", points_m.size(), " points: needs ", kTetrahedron));
  }

  Vector3 low = points_m.front(), high = points_m.front();
  for (const Vector3& p : points_m) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }

  const Extent extent{0.5 * (low + high), 0.5 * (high - low)};
  const auto flat = [&] {
    return failure(ErrorCode::DegenerateGeometry,
                   message("volume of ", points_m.size(), " points: they are in a plane (extents ",
                           kMmPerM * (high - low).transpose(), " mm)"));
  };

  if (!(extent.half_width_m.minCoeff() > 0.0)) {
    return flat();
  }

  Vector3 mean = Vector3::Zero();
  for (const Vector3& p : points_m) {
    mean += extent.scaled(p) / static_cast<double>(points_m.size());
  }

  Matrix3 scatter = Matrix3::Zero();
  for (const Vector3& p : points_m) {
    const Vector3 d = extent.scaled(p) - mean;
    scatter.noalias() += d * d.transpose();
  }

  const Eigen::SelfAdjointEigenSolver<Matrix3> eigen(scatter, Eigen::EigenvaluesOnly);
  if (!(eigen.eigenvalues()(0) > kThin * kThin * eigen.eigenvalues()(2))) {
    return flat();
  }

  return extent;
}

}  // namespace abbe::calib::verify
