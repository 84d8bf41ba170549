#include "abbe/calib/estimation/datum.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "abbe/calib/estimation/null_space.hpp"
#include "estimation/column_scale.hpp"
#include "message.hpp"

namespace abbe::calib::estimation {
namespace {

/// Names of the unknowns with the largest share in the directions that the data do not determine.
std::string largest_shares(const Eigen::VectorXd& shares, const DatumOptions& options) {
  std::vector<std::size_t> order(static_cast<std::size_t>(shares.size()));
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return shares(static_cast<Eigen::Index>(a)) > shares(static_cast<Eigen::Index>(b));
  });

  constexpr std::size_t kMostNamed = 6;
  std::string list;
  for (std::size_t i = 0; i < std::min(kMostNamed, order.size()); ++i) {
    if (shares(static_cast<Eigen::Index>(order[i])) > 0) {
      list += list.empty() ? "" : ", ";
      list += options.label ? options.label(order[i]) : message("unknown ", order[i]);
    }
  }

  return list;
}

/// RankDeficient if an unknown has no observation.
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

/// Conditions for the scaled unknowns, each of length sqrt(weight).
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

/// Sets unknowns to exactly zero, in value and covariance, if a condition consists of this unknown
/// alone.
void set_fixed_to_zero(const Eigen::MatrixXd& K, DatumSolution& s) {
  for (Eigen::Index i = 0; i < K.rows(); ++i) {
    if ((K.row(i).array() != 0).count() != 1) {
      continue;
    }
    Eigen::Index fixed = 0;
    K.row(i).cwiseAbs().maxCoeff(&fixed);
    s.U(fixed) = 0.0;
    s.covariance.row(fixed).setZero();
    s.covariance.col(fixed).setZero();
    s.cofactor_Q.row(fixed).setZero();
  }
}

}  // namespace

Result<DatumSolution> Datum::solve(const Information& data, const DatumOptions& options) const {
  if (!(options.weight > 0)) {
    return failure(ErrorCode::BadInput,
                   message("adjustment: gauge weight ", options.weight, " must be positive"));
  }

  if (Result<void> valid = check_every_unknown(data, options); !valid) {
    return tl::unexpected(valid.error());
  }

  const Spectrum of_data = spectrum(data);
  const auto conditions = static_cast<std::size_t>(K_.rows());
  const std::size_t unknowns = data.unknowns();
  if (of_data.rank + conditions < unknowns) {
    return failure(
        ErrorCode::RankDeficient,
        message("adjustment: rank ", of_data.rank, " from ", data.rows(), " observations, needs ",
                unknowns - conditions, "; not determined: combinations of ",
                largest_shares(null_space(data).share, options)));
  }

  // [R; sqrt(mu) K] of the scaled unknowns.
  const Eigen::VectorXd scale = column_scale(data);
  const Eigen::MatrixXd R = data.R() * scale.asDiagonal();
  Information bordered(unknowns);
  bordered.add_rows(R, data.z());
  bordered.add_rows(scaled_conditions(K_, scale, options.weight), Eigen::VectorXd::Zero(K_.rows()));
  // A combination that neither data nor conditions determine leaves only rounding on the diagonal.
  const Eigen::MatrixXd T = bordered.R();
  if (!(T.diagonal().minCoeff() > of_data.threshold)) {
    return failure(
        ErrorCode::RankDeficient,
        message("adjustment: the conditions of the gauge do not fix all combinations of ", unknowns,
                " unknowns that the data leave undetermined"));
  }

  const auto n = static_cast<Eigen::Index>(unknowns);
  const Eigen::MatrixXd T_inverse =
      T.triangularView<Eigen::Upper>().solve(Eigen::MatrixXd::Identity(n, n));
  const Eigen::MatrixXd noise =
      options.noise == nullptr ? R : Eigen::MatrixXd(options.noise->R() * scale.asDiagonal());
  const Eigen::MatrixXd scaled_T_inverse = scale.asDiagonal() * T_inverse;
  const Eigen::MatrixXd G = scaled_T_inverse * (noise * T_inverse).transpose();

  DatumSolution s;
  s.U = scaled_T_inverse * bordered.z();
  s.covariance = G * G.transpose();
  s.cofactor_Q = scaled_T_inverse * scaled_T_inverse.transpose();
  s.rank = of_data.rank;
  s.datum_defect = unknowns - of_data.rank;
  s.condition = of_data.condition;
  set_fixed_to_zero(K_, s);

  return s;
}

Result<Eigen::MatrixXd> Datum::transformation(const Eigen::MatrixXd& null_space) const {
  const Eigen::MatrixXd N = null_space.colwise().normalized();
  const Eigen::MatrixXd K = K_.rowwise().normalized();
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> KN(K * N);

  // Entries are at most 1; a combination that the conditions do not contain leaves only rounding.
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
