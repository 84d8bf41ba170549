#pragma once
/// Random regression problems, deterministic from the seed.

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <random>

namespace abbe::tests::sparse {

struct Problem {
  Eigen::MatrixXd X;
  Eigen::VectorXd y;
};

/// Neighbouring columns have a correlation of 0.5 and different scales and means; y depends on
/// every fourth column.
inline Problem random_problem(Eigen::Index rows, Eigen::Index columns, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  Problem problem{Eigen::MatrixXd(rows, columns), Eigen::VectorXd(rows)};

  for (Eigen::Index i = 0; i < rows; ++i) {
    double shared = normal(random);
    problem.y(i) = 3.0 + 0.3 * normal(random);
    for (Eigen::Index j = 0; j < columns; ++j) {
      shared = 0.5 * shared + std::sqrt(0.75) * normal(random);
      problem.X(i, j) = (shared + 2.0) * std::pow(10.0, static_cast<double>(j % 5));
      if (j % 4 == 0) problem.y(i) += (j % 8 == 0 ? 1.0 : -0.6) * shared;
    }
  }

  return problem;
}

/// Columns 1 .. 15 of the Hadamard matrix of order 16: mean 0, mean square 1, orthogonal, so that
/// each coefficient is estimated independently of the others.
inline Eigen::MatrixXd orthogonal_design() {
  Eigen::MatrixXd X(16, 15);
  for (int i = 0; i < 16; ++i) {
    for (int j = 1; j < 16; ++j) {
      X(i, j - 1) = __builtin_popcount(static_cast<unsigned>(i & j)) % 2 == 0 ? 1.0 : -1.0;
    }
  }
  return X;
}

}  // namespace abbe::tests::sparse
