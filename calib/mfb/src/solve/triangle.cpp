#include "solve/triangle.hpp"

#include <cmath>

namespace abbe::calib::mfb {
namespace {

void add_multiple(double* __restrict to, double factor, const double* from, Eigen::Index begin,
                  Eigen::Index end) {
  for (Eigen::Index c = begin; c < end; ++c) {
    to[c] += factor * from[c];
  }
}

}  // namespace

RowMajorRows inverse_of_upper(const RowMajorRows& R) {
  const Eigen::Index n = R.rows();
  RowMajorRows X = RowMajorRows::Zero(n, n);
  for (Eigen::Index i = n; i-- > 0;) {
    double* row = X.row(i).data();
    for (Eigen::Index k = i + 1; k < n; ++k) {
      add_multiple(row, -R(i, k), X.row(k).data(), k, n);
    }
    row[i] = 1.0;
    for (Eigen::Index c = i; c < n; ++c) {
      row[c] /= R(i, i);
    }
  }
  return X;
}

Eigen::MatrixXd upper_times_transpose(const RowMajorRows& X) {
  const Eigen::Index n = X.rows();
  const RowMajorRows columns = X.transpose();  // row k: column k of X, zero after element k
  RowMajorRows product = RowMajorRows::Zero(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index k = i; k < n; ++k) {
      add_multiple(product.row(i).data(), X(i, k), columns.row(k).data(), i, k + 1);
    }
  }
  Eigen::MatrixXd symmetric = product;
  symmetric.triangularView<Eigen::StrictlyLower>() = symmetric.transpose();
  return symmetric;
}

RowMajorRows times_upper(const RowMajorRows& A, const RowMajorRows& X) {
  RowMajorRows product = RowMajorRows::Zero(A.rows(), X.cols());
  for (Eigen::Index i = 0; i < A.rows(); ++i) {
    for (Eigen::Index k = 0; k < X.rows(); ++k) {
      add_multiple(product.row(i).data(), A(i, k), X.row(k).data(), k, X.cols());
    }
  }
  return product;
}

double largest_singular_value(const RowMajorRows& A) {
  constexpr int kMostSteps = 60;
  constexpr double kSettled = 1e-4;
  Eigen::VectorXd v = Eigen::VectorXd::Ones(A.cols()).normalized();
  double value = 0.0;
  for (int step = 0; step < kMostSteps; ++step) {
    const Eigen::VectorXd Av = A * v;
    Eigen::VectorXd next = Eigen::VectorXd::Zero(A.cols());
    for (Eigen::Index i = 0; i < A.rows(); ++i) {
      add_multiple(next.data(), Av(i), A.row(i).data(), 0, A.cols());
    }
    const double before = value;
    value = Av.norm();
    if (!(next.norm() > 0.0) || std::abs(value - before) < kSettled * value) {
      break;
    }
    v = next.normalized();
  }
  return value;
}

}  // namespace abbe::calib::mfb
