#pragma once
/// The reference implementation with which bench_sparse_grid compares: SCAD paths by coordinate
/// descent that updates the residual after each coefficient, one path after the other, in plain
/// loops. Standardisation, warm starts, strong and active sets, stopping rule and budget are those
/// of abbe::calib::sparse, so that every sweep count can be compared.

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace abbe::bench {

struct ResidualPath {
  std::vector<std::vector<double>> b;  ///< of each lambda that was reached
  std::vector<long> sweeps;
};

class ResidualDescent {
 public:
  /// The columns of X must be standardised, and y must be centred.
  ResidualDescent(const Eigen::MatrixXd& X, const Eigen::VectorXd& y)
      : n_(static_cast<std::size_t>(X.rows())),
        p_(static_cast<std::size_t>(X.cols())),
        x_(X.data(), X.data() + X.size()),
        y_(y.begin(), y.end()) {}

  ResidualPath scad(double gamma, const std::vector<double>& lambda, double tolerance,
                    long budget) {
    start(gamma);
    ResidualPath path;
    double before = 0.0;

    for (const double z : z_) {
      before = std::max(before, std::abs(z));
    }

    long total = 0;
    for (const double l : lambda) {
      if (total == budget) break;
      const double cutoff = l + gamma / (gamma - 2) * (l - before);
      for (std::size_t j = 0; j < p_; ++j) {
        if (std::abs(z_[j]) > cutoff) strong_[j] = 1;
      }
      const long used = solve(l, tolerance * rms(), budget - total);
      total += used;
      path.sweeps.push_back(used);
      path.b.push_back(b_);
      before = l;
    }

    return path;
  }

 private:
  void start(double gamma) {
    gamma_ = gamma;
    r_ = y_;
    b_.assign(p_, 0.0);
    z_.resize(p_);
    active_.assign(p_, 0);
    strong_.assign(p_, 0);
    for (std::size_t j = 0; j < p_; ++j) {
      z_[j] = inner_product(j);
    }
  }

  [[nodiscard]] double rms() const {
    double sum = 0.0;
    for (const double v : y_) {
      sum += v * v;
    }
    return std::sqrt(sum / static_cast<double>(n_));
  }

  long solve(double l, double change_limit, long budget) {
    long sweeps = 0;
    while (sweeps < budget) {
      while (sweeps < budget) {
        while (sweeps < budget) {
          ++sweeps;
          if (sweep(l) < change_limit) break;
        }
        if (!admit(l, true)) break;
      }
      if (!admit(l, false)) break;
    }
    return sweeps;
  }

  double sweep(double l) {
    double largest = 0.0;
    for (std::size_t j = 0; j < p_; ++j) {
      if (active_[j] == 0) continue;
      z_[j] = inner_product(j) + b_[j];
      largest = std::max(largest, std::abs(move_to(j, shrink(l, z_[j]))));
    }
    return largest;
  }

  bool admit(double l, bool strong) {
    bool entered = false;
    for (std::size_t j = 0; j < p_; ++j) {
      if (active_[j] != 0 || (strong_[j] != 0) != strong) continue;
      z_[j] = inner_product(j);
      const double b = shrink(l, z_[j]);
      if (b == 0.0) continue;
      move_to(j, b);
      active_[j] = strong_[j] = 1;
      entered = true;
    }
    return entered;
  }

  [[nodiscard]] double shrink(double l, double z) const {
    const double size = std::abs(z);
    if (size <= l) return 0.0;
    if (size <= 2 * l) return std::copysign(size - l, z);
    if (size <= gamma_ * l)
      return std::copysign((size - gamma_ * l / (gamma_ - 1)) / (1 - 1 / (gamma_ - 1)), z);
    return z;
  }

  [[nodiscard]] double inner_product(std::size_t j) const {
    const double* x = &x_[j * n_];
    double sum = 0.0;
    for (std::size_t i = 0; i < n_; ++i) {
      sum += x[i] * r_[i];
    }
    return sum / static_cast<double>(n_);
  }

  double move_to(std::size_t j, double b) {
    const double change = b - b_[j];
    if (change == 0.0) return 0.0;
    const double* x = &x_[j * n_];
    for (std::size_t i = 0; i < n_; ++i) {
      r_[i] -= change * x[i];
    }
    b_[j] = b;
    return change;
  }

  std::size_t n_, p_;
  double gamma_ = 0.0;
  std::vector<double> x_, y_, r_, b_, z_;
  std::vector<char> active_, strong_;
};

}  // namespace abbe::bench
