#include "abbe/calib/internal/fit/line.hpp"

#include <cmath>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/fit/point_set.hpp"
#include "abbe/result/try.hpp"

namespace abbe::calib::fit {
namespace {

/// Statistics of the distances from the line. The degrees of freedom count both components across
/// the line as residuals.
ResidualStatistics statistics_of_line(const Eigen::Matrix3Xd& across) {
  constexpr std::size_t kUnknownsOfLine = 4;
  const auto points = static_cast<std::size_t>(across.cols());
  const Eigen::VectorXd distance = across.colwise().norm();
  ResidualStatistics s = residual_statistics(distance, 0);
  s.degrees_of_freedom = 2 * points - kUnknownsOfLine;
  s.sigma0 = s.degrees_of_freedom > 0
                 ? std::sqrt(distance.squaredNorm() / static_cast<double>(s.degrees_of_freedom))
                 : 0.0;
  return s;
}

}  // namespace

Result<Line> fit_line(std::span<const Vector3> points, const Vector3& towards,
                      std::optional<double> known_sigma) {
  const Result<PointSet> set = point_set(points, 2, "line");
  ABBE_TRY(set);

  const Vector3& extents = set->singular_values;
  if (!(extents(0) - extents(1) > PointSet::kDegenerate * extents(0))) {
    return failure(
        ErrorCode::DegenerateGeometry,
        message("line: the ", points.size(), " points extend equally in two directions (extents ",
                extents.transpose(), ")"));
  }

  Line line;
  line.point = set->centroid;
  line.direction = set->directions.col(0);
  const double along = line.direction.dot(towards);
  if (!(std::abs(along) > PointSet::kDegenerate * towards.norm())) {
    return failure(ErrorCode::DegenerateGeometry,
                   "line: the given direction is perpendicular to the line and does not tell its "
                   "two directions apart");
  }
  if (along < 0) {
    line.direction = -line.direction;
  }

  const Matrix3 across = Matrix3::Identity() - line.direction * line.direction.transpose();
  line.residuals = statistics_of_line(across * set->centred);
  const double sigma = known_sigma.value_or(line.residuals.sigma0);
  line.cov_point = sigma * sigma / static_cast<double>(points.size()) * across;
  line.cov_direction = sigma * sigma / (extents(0) * extents(0)) * across;
  return line;
}

}  // namespace abbe::calib::fit
