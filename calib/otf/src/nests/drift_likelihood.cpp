#include "nests/drift_likelihood.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <limits>

#include "abbe/calib/internal/base/check_stopped.hpp"
#include "abbe/calib/internal/statistics/elementary.hpp"
#include "abbe/result/try.hpp"

namespace abbe::calib::otf {
namespace {

constexpr std::array kRepeatabilityFactors{1.0, 2.0, 4.0, 8.0};
constexpr double kLeastAmplitude_m = 0.1e-6;
constexpr int kAmplitudes = 14;  // each is twice the previous one: up to 0.8 mm

/// Eliminates the range offset from the equations and makes the remaining part of P tridiagonal.
void make_tridiagonal(ScaledEquations& e, Eigen::Index offsets) {
  const Eigen::Index n = e.b.size() - offsets;
  Eigen::MatrixXd P = e.P.bottomRightCorner(n, n);
  Eigen::VectorXd b = e.b.tail(n);
  if (offsets > 0) {
    const double of_offset = 1.0 + e.P(0, 0);
    const Eigen::VectorXd beside = e.P.col(0).tail(n);
    P -= beside * beside.transpose() / of_offset;
    b -= beside * (e.b(0) / of_offset);
    e.constant += natural_logarithm(of_offset) - e.b(0) * e.b(0) / of_offset;
  }

  const Eigen::Tridiagonalization<Eigen::MatrixXd> t(P);
  e.diagonal = t.diagonal();
  e.beside_diagonal = t.subDiagonal();
  e.b_tridiagonal = t.matrixQ().adjoint() * b;
}

/// Log likelihood of the equations for an amplitude a. T: tridiagonal P, c: b in its coordinates.
///     ln(likelihood) = -(constant + ln det(I + a^2 T) - a^2 c^T (I + a^2 T)^-1 c) / 2
double log_likelihood(const ScaledEquations& e, double amplitude_m) {
  const double squared = amplitude_m * amplitude_m;
  double pivot = 1.0, rest = 0.0, log_determinant = 0.0, product = 0.0;
  for (Eigen::Index i = 0; i < e.diagonal.size(); ++i) {
    const double beside = i > 0 ? squared * e.beside_diagonal(i - 1) : 0.0;
    const double ratio = beside / pivot;
    pivot = 1.0 + squared * e.diagonal(i) - ratio * beside;
    rest = amplitude_m * e.b_tridiagonal(i) - ratio * rest;
    if (!(pivot > 0.0)) {
      return -std::numeric_limits<double>::infinity();
    }
    log_determinant += natural_logarithm(pivot);
    product += rest * rest / pivot;
  }
  return -0.5 * (e.constant + log_determinant - product);
}

}  // namespace

struct DriftLikelihood::Factors {
  Eigen::VectorXd scale;              ///< D: amplitude, or 1 for the range offset
  Eigen::LLT<Eigen::MatrixXd> llt{};  ///< Cholesky factor of I + D P D
};

const DriftCell& LikelihoodGrid::best() const {
  return *std::max_element(cells.begin(), cells.end(), [](const DriftCell& a, const DriftCell& b) {
    return a.log_likelihood < b.log_likelihood;
  });
}

DriftLikelihood::DriftLikelihood(const DriftObservations& d, const DriftEquations& equations)
    : d_(d), equations_(equations), basis_(d), nests_(d, basis_) {
  for (const DriftCourse course : kDriftCourses) {
    roots_.emplace(course, basis_.root_of_prior(course));
  }
}

Eigen::MatrixXd DriftLikelihood::root_times(DriftCourse course, const Eigen::MatrixXd& x) const {
  const Eigen::MatrixXd& root = roots_.at(course);
  const Eigen::Index k = equations_.offsets(), m = static_cast<Eigen::Index>(basis_.modes());
  Eigen::MatrixXd product = Eigen::MatrixXd::Zero(x.rows(), x.cols());
  product.topRows(k) = equations_.u_range_offset_m * x.topRows(k);
  for (Eigen::Index i = 0; i < root.rows(); ++i) {
    for (Eigen::Index j = 0; j <= i; ++j) {
      product.middleRows(k + i * m, m) += root(i, j) * x.middleRows(k + j * m, m);
    }
  }
  return product;
}

Eigen::MatrixXd DriftLikelihood::root_transposed_times(DriftCourse course,
                                                       const Eigen::MatrixXd& x) const {
  const Eigen::MatrixXd& root = roots_.at(course);
  const Eigen::Index k = equations_.offsets(), m = static_cast<Eigen::Index>(basis_.modes());
  Eigen::MatrixXd product = Eigen::MatrixXd::Zero(x.rows(), x.cols());
  product.topRows(k) = equations_.u_range_offset_m * x.topRows(k);
  for (Eigen::Index i = 0; i < root.rows(); ++i) {
    for (Eigen::Index j = 0; j <= i; ++j) {
      product.middleRows(k + j * m, m) += root(i, j) * x.middleRows(k + i * m, m);
    }
  }
  return product;
}

Result<LikelihoodGrid> DriftLikelihood::grid(const NestPlaces& place,
                                             const Stopped& stopped) const {
  LikelihoodGrid grid;
  for (const DriftCourse course : kDriftCourses) {
    for (const double factor : kRepeatabilityFactors) {
      ABBE_TRY(check_stopped(stopped));
      grid.equations.push_back(scaled(place, factor * d_.u_repeatability_m, course));
      double amplitude_m = kLeastAmplitude_m;
      for (int k = 0; k < kAmplitudes; ++k, amplitude_m *= 2.0) {
        grid.cells.push_back({grid.equations.size() - 1, amplitude_m,
                              log_likelihood(grid.equations.back(), amplitude_m)});
      }
    }
  }
  return grid;
}

ScaledEquations DriftLikelihood::scaled(const NestPlaces& place, double u_m,
                                        DriftCourse course) const {
  const NestInformation nests = nests_.information(place, u_m);
  const Eigen::Index m = nests.Nc.size();
  Eigen::MatrixXd information = equations_.S;
  information.bottomRightCorner(m, m) += nests.N;
  Eigen::VectorXd g = equations_.g;
  g.tail(m) += nests.Nc;

  const Eigen::MatrixXd P =
      root_transposed_times(course, root_transposed_times(course, information).transpose());
  ScaledEquations e{.P = 0.5 * (P + P.transpose()),
                    .b = root_transposed_times(course, g),
                    .u_m = u_m,
                    .course = course};
  e.constant = nests.constant;
  make_tridiagonal(e, equations_.offsets());
  return e;
}

DriftLikelihood::Factors DriftLikelihood::factors(const ScaledEquations& e,
                                                  double amplitude_m) const {
  Factors f{.scale = Eigen::VectorXd::Constant(e.b.size(), amplitude_m)};
  f.scale.head(equations_.offsets()).setOnes();
  Eigen::MatrixXd M = f.scale.asDiagonal() * e.P * f.scale.asDiagonal();
  M.diagonal().array() += 1.0;
  f.llt.compute(M);
  return f;
}

Eigen::VectorXd DriftLikelihood::unknowns(const LikelihoodGrid& grid, const DriftCell& cell) const {
  const ScaledEquations& e = grid.equations[cell.equations];
  const Factors f = factors(e, cell.amplitude_m);
  const Eigen::VectorXd x = f.llt.solve(Eigen::VectorXd(f.scale.asDiagonal() * e.b));
  return root_times(e.course, f.scale.asDiagonal() * x);
}

Eigen::MatrixXd DriftLikelihood::covariance(const LikelihoodGrid& grid,
                                            const DriftCell& cell) const {
  const ScaledEquations& e = grid.equations[cell.equations];
  const Factors f = factors(e, cell.amplitude_m);
  const Eigen::MatrixXd scaled_root = root_times(e.course, f.scale.asDiagonal());
  const Eigen::MatrixXd half = f.llt.matrixL().solve(Eigen::MatrixXd(scaled_root.transpose()));
  return half.transpose() * half;
}

}  // namespace abbe::calib::otf
