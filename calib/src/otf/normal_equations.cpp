#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "abbe/calib/otf/solve.hpp"
#include "message.hpp"

namespace abbe::calib::otf {
namespace {

Eigen::MatrixXd symmetric(const Eigen::MatrixXd& lower) {
  return lower.selfadjointView<Eigen::Lower>();
}

Eigen::VectorXd inverse_root(const Eigen::VectorXd& diagonal) {
  return diagonal.cwiseSqrt().cwiseInverse();
}

/// Names of the parameters with the largest share in the directions that the data do not determine.
std::string named_parameters(const Eigen::VectorXd& shares, const ParameterLayout& layout) {
  std::vector<std::size_t> order(static_cast<std::size_t>(shares.size()));
  for (std::size_t i = 0; i < order.size(); ++i) {
    order[i] = i;
  }

  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return shares(static_cast<Eigen::Index>(a)) > shares(static_cast<Eigen::Index>(b));
  });

  constexpr std::size_t kMostNamed = 6;
  std::string list;
  for (std::size_t i = 0; i < std::min(kMostNamed, order.size()); ++i) {
    if (shares(static_cast<Eigen::Index>(order[i])) > 0) {
      list += (list.empty() ? "" : ", ") + layout.label(order[i]);
    }
  }

  return list;
}

/// RankDeficient if a parameter has no observation.
Result<void> check_observed(const Eigen::MatrixXd& H, const ParameterLayout& layout) {
  const Eigen::VectorXd unobserved =
      H.diagonal().unaryExpr([](double d) { return d > 0 ? 0.0 : 1.0; });
  if (unobserved.sum() > 0) {
    return failure(ErrorCode::RankDeficient, message("adjustment: ", unobserved.sum(),
                                                     " parameters have no data, among them ",
                                                     named_parameters(unobserved, layout)));
  }
  return {};
}

struct Spectrum {
  std::size_t rank = 0;
  double condition = 0.0;
  Eigen::VectorXd weakest_share;  ///< of each parameter in the directions below the threshold
};

/// Rank and condition of the data without the gauge. Columns are scaled to unit diagonal, so that
/// every entry is at most 1. Each entry is a sum of `rows` rounded products: its error is below
/// rows * eps, typically sqrt(rows) * eps. The spectral norm of the n x n error matrix is at most n
/// times that. Eigenvalues below this threshold count as zero:
///     n * sqrt(rows) * eps * largest eigenvalue
Spectrum spectrum(const NormalEquations& N) {
  const Eigen::VectorXd scale = inverse_root(N.H.diagonal());
  const Eigen::MatrixXd scaled = scale.asDiagonal() * symmetric(N.H) * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scaled);
  const Eigen::VectorXd& values = eigen.eigenvalues();  // ascending
  const Eigen::Index n = values.size();
  const double zero = static_cast<double>(n) * std::sqrt(static_cast<double>(N.rows)) *
                      std::numeric_limits<double>::epsilon() * values(n - 1);
  Eigen::Index null = 0;

  while (null < n && values(null) <= zero) {
    ++null;
  }

  Spectrum s;
  s.rank = static_cast<std::size_t>(n - null);
  s.condition = s.rank > 0 ? std::sqrt(values(n - 1) / values(null)) : 0.0;
  s.weakest_share = eigen.eigenvectors().leftCols(null).rowwise().squaredNorm();

  return s;
}

/// Sets parameters to exactly zero, in value and covariance, if a gauge condition consists of this
/// parameter alone.
void clear_fixed(const Eigen::MatrixXd& K, Adjustment& a) {
  for (Eigen::Index i = 0; i < K.rows(); ++i) {
    if ((K.row(i).array() != 0).count() != 1) {
      continue;
    }
    Eigen::Index fixed = 0;
    K.row(i).cwiseAbs().maxCoeff(&fixed);
    a.U(fixed) = 0.0;
    a.covariance.row(fixed).setZero();
    a.covariance.col(fixed).setZero();
    a.cofactor_Q.row(fixed).setZero();
  }
}

}  // namespace

NormalEquations::NormalEquations(std::size_t unknowns)
    : H(Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(unknowns),
                              static_cast<Eigen::Index>(unknowns))),
      H_noise(H),
      g(Eigen::VectorXd::Zero(static_cast<Eigen::Index>(unknowns))) {}

void NormalEquations::add(std::span<const SparseRows::Entry> row, const Observation& o) {
  const double noise_weight = o.weight * o.weight * o.sigma_m * o.sigma_m;
  const auto n = static_cast<std::size_t>(H.rows());
  for (std::size_t j = 0; j < row.size(); ++j) {
    double* column = H.data() + row[j].column * n;
    double* noise_column = H_noise.data() + row[j].column * n;
    for (std::size_t i = j; i < row.size(); ++i) {
      const double product = row[i].value * row[j].value;
      column[row[i].column] += o.weight * product;
      noise_column[row[i].column] += noise_weight * product;
    }
    g(static_cast<Eigen::Index>(row[j].column)) += o.weight * row[j].value * o.y_m;
  }

  ++rows;
}

NormalEquations& NormalEquations::operator+=(const NormalEquations& other) {
  H += other.H;
  H_noise += other.H_noise;
  g += other.g;
  rows += other.rows;
  return *this;
}

NormalEquations normal_equations(const Observations& o,
                                 const std::function<bool(const Observation&)>& take) {
  NormalEquations N(o.layout.fit_size());
  for (std::size_t i = 0; i < o.rows.size(); ++i) {
    if (!take || take(o.rows[i])) {
      N.add(o.A.row(i), o.rows[i]);
    }
  }
  return N;
}

Result<Adjustment> adjust(const NormalEquations& N, const ParameterLayout& layout,
                          double gauge_weight) {
  if (!(gauge_weight > 0)) {
    return failure(ErrorCode::BadInput,
                   message("adjustment: gauge weight ", gauge_weight, " must be positive"));
  }

  if (Result<void> valid = check_observed(N.H, layout); !valid) {
    return tl::unexpected(valid.error());
  }

  const Eigen::MatrixXd K = gauge_conditions(Gauge::G1, layout);
  const Spectrum s = spectrum(N);
  const auto free = static_cast<std::size_t>(K.rows());
  const std::size_t unknowns = layout.fit_size();

  if (s.rank + free < unknowns) {
    return failure(ErrorCode::RankDeficient,
                   message("adjustment: rank ", s.rank, " from ", N.rows, " observations, needs ",
                           unknowns - free, "; not determined: combinations of ",
                           named_parameters(s.weakest_share, layout)));
  }

  const double mu = gauge_weight * N.H.trace() / K.squaredNorm();
  const Eigen::MatrixXd bordered = symmetric(N.H) + mu * (K.transpose() * K);
  const Eigen::VectorXd scale = inverse_root(bordered.diagonal());
  const Eigen::LLT<Eigen::MatrixXd> factor(scale.asDiagonal() * bordered * scale.asDiagonal());

  if (factor.info() != Eigen::Success) {
    return failure(ErrorCode::RankDeficient,
                   message("adjustment: normal equations of ", unknowns,
                           " unknowns are not positive definite in gauge G1"));
  }

  Adjustment a;
  a.U = scale.asDiagonal() * factor.solve(scale.asDiagonal() * N.g);
  const auto n = static_cast<Eigen::Index>(unknowns);
  const Eigen::MatrixXd inverse = factor.solve(Eigen::MatrixXd::Identity(n, n));
  const Eigen::MatrixXd Q = scale.asDiagonal() * inverse * scale.asDiagonal();
  const Eigen::MatrixXd QHQ = Q * symmetric(N.H_noise) * Q.transpose();
  a.covariance = 0.5 * (QHQ + QHQ.transpose());
  a.rank = s.rank;
  a.datum_defect = unknowns - s.rank;
  a.condition = s.condition;
  a.cofactor_Q = Q;
  clear_fixed(K, a);

  return a;
}

}  // namespace abbe::calib::otf
