#include "abbe/calib/estimation/datum.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/estimation/null_space.hpp"
#include "abbe/result/try.hpp"
#include "column_scale.hpp"

namespace abbe::calib::estimation {
namespace {

/// Names of the unknowns with the largest share in the combinations that are not determined. A
/// share is the squared entry of a unit vector. Shares of determined unknowns are rounding errors.
std::string largest_shares(const Eigen::VectorXd& shares, const DatumOptions& options) {
  std::vector<std::size_t> order(static_cast<std::size_t>(shares.size()));
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return shares(static_cast<Eigen::Index>(a)) > shares(static_cast<Eigen::Index>(b));
  });

  constexpr std::size_t kMostNamed = 6;
  constexpr double kRoundingShare = 1e-8;
  std::string list;
  for (std::size_t i = 0; i < std::min(kMostNamed, order.size()); ++i) {
    if (shares(static_cast<Eigen::Index>(order[i])) > kRoundingShare) {
      list += list.empty() ? "" : ", ";
      list += options.label ? options.label(order[i]) : message("unknown ", order[i]);
    }
  }

  return list;
}

/// Returns RankDeficient if an unknown has no observation.
Result<void> check_every_unknown(const Information& data, const DatumOptions& options) {
  Eigen::VectorXd unobserved(static_cast<Eigen::Index>(data.unknowns()));
  for (std::size_t i = 0; i < data.unknowns(); ++i) {
    unobserved(static_cast<Eigen::Index>(i)) = data.squared_length(i) > 0.0 ? 0.0 : 1.0;
  }

  if (unobserved.sum() > 0) {
    return failure(ErrorCode::RankDeficient, message("adjustment: ", unobserved.sum(),
                                                     " parameters have no data, among them ",
                                                     largest_shares(unobserved, options)));
  }

  return {};
}

/// The conditions K for the unknowns divided by `scale`, each row scaled to the length
/// sqrt(weight).
Eigen::MatrixXd scaled_conditions(const Eigen::MatrixXd& K, const Eigen::VectorXd& scale,
                                  double weight) {
  Eigen::MatrixXd rows = K * scale.asDiagonal();
  for (Eigen::Index i = 0; i < rows.rows(); ++i) {
    if (const double norm = rows.row(i).norm(); norm > 0.0) {
      rows.row(i) *= std::sqrt(weight) / norm;
    }
  }
  return rows;
}

/// Indices of the unknowns that a condition with a single nonzero entry sets to zero. Their value
/// and covariance are exactly zero, without rounding errors.
std::vector<Eigen::Index> fixed_alone(const Eigen::MatrixXd& K) {
  std::vector<Eigen::Index> fixed;
  for (Eigen::Index i = 0; i < K.rows(); ++i) {
    if ((K.row(i).array() != 0).count() == 1) {
      K.row(i).cwiseAbs().maxCoeff(&fixed.emplace_back());
    }
  }
  return fixed;
}

Result<void> check_solvable(const Information& data, const DatumOptions& options) {
  if (!(options.weight > 0)) {
    return failure(ErrorCode::BadInput,
                   message("adjustment: datum weight ", options.weight, " must be positive"));
  }
  return check_every_unknown(data, options);
}

/// Information of the data rows and the conditions K, for the unknowns divided by `scale`.
Information bordered_rows(const Information& data, const Eigen::MatrixXd& K,
                          const Eigen::VectorXd& scale, double weight) {
  Information bordered(data.unknowns());
  bordered.add_rows(data.R() * scale.asDiagonal(), data.z());
  bordered.add_rows(scaled_conditions(K, scale, weight), Eigen::VectorXd::Zero(K.rows()));
  return bordered;
}

/// Returns RankDeficient, with the names of the unknowns, if data of this rank and the conditions
/// together do not determine all unknowns.
Result<void> check_rank(const Information& data, std::size_t rank, const Eigen::MatrixXd& K,
                        const DatumOptions& options) {
  const std::size_t with_conditions = rank + static_cast<std::size_t>(K.rows());
  if (with_conditions >= data.unknowns()) {
    return {};
  }
  const Information bordered = bordered_rows(data, K, column_scale(data), options.weight);
  return failure(
      ErrorCode::RankDeficient,
      message("adjustment: rank ", rank, " from ", data.rows(), " observations, needs ",
              data.unknowns() - static_cast<std::size_t>(K.rows()),
              "; not determined: combinations of ",
              largest_shares(null_space_of_rank(bordered, with_conditions).share, options)));
}

/// Triangular factor T of [R; sqrt(mu) K] (datum.hpp), for the unknowns divided by `scale`.
struct BorderedTriangle {
  Eigen::VectorXd scale;
  Eigen::MatrixXd T;
  Eigen::VectorXd z;
};

Result<BorderedTriangle> bordered_triangle(const Information& data, const Eigen::MatrixXd& K,
                                           const DatumOptions& options) {
  const Eigen::VectorXd scale = column_scale(data);
  const Information bordered = bordered_rows(data, K, scale, options.weight);

  // A combination of unknowns that neither data nor conditions determine has a diagonal element of
  // T that consists of rounding errors only.
  constexpr double kZero = 1e-11;
  BorderedTriangle result{scale, bordered.R(), bordered.z()};
  if (!(result.T.diagonal().minCoeff() > kZero)) {
    const std::size_t rank = std::min(pivoted_rank(bordered, kZero), data.unknowns() - 1);
    return failure(
        ErrorCode::RankDeficient,
        message("adjustment: ",
                K.rows() == 0 ? "the data do not determine"
                              : "neither the data nor the conditions of the datum determine",
                " combinations of ",
                largest_shares(null_space_of_rank(bordered, rank).share, options)));
  }
  return result;
}

}  // namespace

Result<DatumSolution> Datum::solve(const Information& data, const DatumOptions& options) const {
  ABBE_TRY(check_solvable(data, options));

  const Spectrum of_data = spectrum(data, options.zero);
  ABBE_TRY(check_rank(data, of_data.rank, K_, options));

  const Result<BorderedTriangle> bordered = bordered_triangle(data, K_, options);
  ABBE_TRY(bordered);

  const Eigen::VectorXd& scale = bordered->scale;
  const auto n = scale.size();
  const Eigen::MatrixXd T_inverse =
      bordered->T.triangularView<Eigen::Upper>().solve(Eigen::MatrixXd::Identity(n, n));
  const Eigen::MatrixXd noise =
      (options.noise == nullptr ? data : *options.noise).R() * scale.asDiagonal();
  const Eigen::MatrixXd scaled_T_inverse = scale.asDiagonal() * T_inverse;
  const Eigen::MatrixXd G = scaled_T_inverse * (noise * T_inverse).transpose();

  DatumSolution s;
  s.U = scaled_T_inverse * bordered->z;
  s.covariance = G * G.transpose();
  s.cofactor_Q = scaled_T_inverse * scaled_T_inverse.transpose();
  s.rank = of_data.rank;
  s.datum_defect = data.unknowns() - of_data.rank;
  s.condition = of_data.condition;
  for (const Eigen::Index fixed : fixed_alone(K_)) {
    s.U(fixed) = 0.0;
    s.covariance.row(fixed).setZero();
    s.covariance.col(fixed).setZero();
    s.cofactor_Q.row(fixed).setZero();
  }

  return s;
}

Result<Eigen::VectorXd> Datum::estimate(const Information& data,
                                        const DatumOptions& options) const {
  ABBE_TRY(check_solvable(data, options));

  const std::size_t rank = pivoted_rank(data, options.zero);
  ABBE_TRY(check_rank(data, rank, K_, options));

  const Result<BorderedTriangle> bordered = bordered_triangle(data, K_, options);
  ABBE_TRY(bordered);

  Eigen::VectorXd U =
      bordered->scale.asDiagonal() *
      Eigen::VectorXd(bordered->T.triangularView<Eigen::Upper>().solve(bordered->z));
  for (const Eigen::Index fixed : fixed_alone(K_)) {
    U(fixed) = 0.0;
  }

  return U;
}

Result<Eigen::MatrixXd> Datum::transformation(const Eigen::MatrixXd& null_space) const {
  const Eigen::MatrixXd N = null_space.colwise().normalized();
  const Eigen::MatrixXd K = K_.rowwise().normalized();
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> KN(K * N);

  // The columns of N and the rows of K have unit length, so entries of K N are at most 1. For a
  // combination in N that no condition fixes, a pivot of K N consists of rounding errors only.
  constexpr double kZero = 1e-9;
  const auto fixed = (KN.matrixQR().diagonal().array().abs() > kZero).count();
  if (fixed < N.cols()) {
    return failure(ErrorCode::DegenerateGeometry,
                   message("datum: ", K_.rows(), " conditions fix ", fixed, " of ", N.cols(),
                           " combinations that the data leave undetermined"));
  }

  return Eigen::MatrixXd::Identity(N.rows(), N.rows()) - N * KN.solve(K);
}

}  // namespace abbe::calib::estimation
