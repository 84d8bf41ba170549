#include "abbe/calib/internal/fit/point_set.hpp"

#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <vector>

#include "abbe/calib/internal/base/message.hpp"

namespace abbe::calib::fit {
namespace {

std::size_t distinct_points(const Eigen::Matrix3Xd& centred, double size) {
  std::vector<Vector3> different;
  for (Eigen::Index i = 0; i < centred.cols(); ++i) {
    const bool known = std::any_of(different.begin(), different.end(), [&](const Vector3& p) {
      return (p - centred.col(i)).norm() <= PointSet::kDegenerate * size;
    });
    if (!known) {
      different.emplace_back(centred.col(i));
    }
  }
  return different.size();
}

}  // namespace

Result<PointSet> point_set(std::span<const Vector3> points, std::size_t needed, const char* what) {
  PointSet set;
  set.centred.resize(3, static_cast<Eigen::Index>(points.size()));
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!points[i].allFinite()) {
      return failure(ErrorCode::NotFinite, message(what, ": point ", i, " is not a number"));
    }
    set.centred.col(static_cast<Eigen::Index>(i)) = points[i];
  }

  if (points.size() >= needed && !points.empty()) {
    // The mean is computed from coordinates relative to the first point, because the mean of large
    // coordinates would lose digits.
    set.centred.colwise() -= points.front();
    const Vector3 mean = set.centred.rowwise().mean();
    set.centred.colwise() -= mean;
    set.centroid = points.front() + mean;
    set.size = set.centred.colwise().norm().maxCoeff();
    set.distinct = distinct_points(set.centred, set.size);
  } else {
    set.distinct = points.size();
  }

  if (set.distinct < needed) {
    return failure(ErrorCode::TooFewObservations,
                   message(what, ": ", set.distinct, " different points, needs ", needed));
  }

  // R of the QR decomposition of the points has the same singular values and right singular
  // vectors, and is 3 x 3 for any number of points.
  const Eigen::HouseholderQR<Eigen::MatrixX3d> qr(set.centred.transpose());
  const Eigen::Index rank = std::min<Eigen::Index>(3, set.centred.cols());
  Matrix3 R = Matrix3::Zero();
  R.topRows(rank) = qr.matrixQR().topRows(rank);
  R.triangularView<Eigen::StrictlyLower>().setZero();
  const Eigen::JacobiSVD<Matrix3, Eigen::NoQRPreconditioner> svd(R, Eigen::ComputeFullV);

  if (svd.info() != Eigen::Success) {  // coordinates whose squares overflow
    return failure(ErrorCode::NotFinite, message(what, ": points too far apart"));
  }

  set.directions = svd.matrixV();
  set.singular_values = svd.singularValues();
  return set;
}

}  // namespace abbe::calib::fit
