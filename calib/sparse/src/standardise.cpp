#include "abbe/calib/internal/sparse/standardise.hpp"

#include <cmath>

#include "abbe/calib/internal/base/message.hpp"

namespace abbe::calib::sparse {
namespace {

Eigen::VectorXd root_mean_square(const Eigen::MatrixXd& centred) {
  return (centred.colwise().squaredNorm().transpose() / static_cast<double>(centred.rows()))
      .cwiseSqrt();
}

}  // namespace

Result<Standardised> standardise(const Eigen::MatrixXd& X) {
  if (X.rows() == 0) return failure(ErrorCode::BadInput, "standardise columns: no row");
  if (!X.allFinite())
    return failure(ErrorCode::NotFinite, "standardise columns: NaN or infinity in the design");
  const Eigen::VectorXd mean = X.colwise().mean();
  const Eigen::MatrixXd centred = X.rowwise() - mean.transpose();
  const Eigen::VectorXd scale = root_mean_square(centred);

  if (!scale.allFinite()) {
    return failure(ErrorCode::NotFinite,
                   "standardise columns: squares of the design are too large for a double");
  }

  Standardised out;
  out.original_columns = X.cols();
  for (Eigen::Index j = 0; j < X.cols(); ++j) {
    if (scale(j) > kConstantColumn) out.kept.push_back(j);
  }

  if (out.kept.empty()) {
    return failure(ErrorCode::BadInput, message("standardise columns: none of ", X.cols(),
                                                " columns varies over ", X.rows(), " rows"));
  }

  out.mean = mean(out.kept);
  out.scale = scale(out.kept);
  out.X = centred(Eigen::all, out.kept) * out.scale.cwiseInverse().asDiagonal();

  return out;
}

Eigen::MatrixXd to_original(const Standardised& design, const Eigen::MatrixXd& b, double y_mean) {
  Eigen::MatrixXd coefficients = Eigen::MatrixXd::Zero(1 + design.original_columns, b.cols());
  const Eigen::MatrixXd slopes = design.scale.cwiseInverse().asDiagonal() * b;
  for (std::size_t i = 0; i < design.kept.size(); ++i) {
    coefficients.row(1 + design.kept[i]) = slopes.row(static_cast<Eigen::Index>(i));
  }
  coefficients.row(0) = (-design.mean.transpose() * slopes).array() + y_mean;
  return coefficients;
}

}  // namespace abbe::calib::sparse
