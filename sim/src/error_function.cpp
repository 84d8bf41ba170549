#include "abbe/sim/error_function.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <utility>

namespace abbe::sim {
namespace {

/// Second derivatives of the natural cubic spline: the tridiagonal system of its continuity
/// conditions, by elimination.
std::vector<double> natural_curvature(std::span<const double> x, std::span<const double> y) {
  const std::size_t n = x.size();
  std::vector<double> curvature(n, 0.0);
  std::vector<double> upper(n, 0.0);

  for (std::size_t i = 1; i + 1 < n; ++i) {
    const double h0 = x[i] - x[i - 1];
    const double h1 = x[i + 1] - x[i];
    const double rhs = 6.0 * ((y[i + 1] - y[i]) / h1 - (y[i] - y[i - 1]) / h0);
    const double pivot = 2.0 * (h0 + h1) - h0 * upper[i - 1];
    upper[i] = h1 / pivot;
    curvature[i] = (rhs - h0 * curvature[i - 1]) / pivot;
  }

  for (std::size_t i = n - 1; i-- > 1;) curvature[i] -= upper[i] * curvature[i + 1];
  return curvature;
}

}  // namespace

ErrorFunction::ErrorFunction(std::vector<double> nodes_m, std::vector<double> values, Shape shape)
    : nodes_m_(std::move(nodes_m)), values_(std::move(values)), shape_(shape) {
  assert(nodes_m_.size() >= 2 && nodes_m_.size() == values_.size());
  assert(std::is_sorted(nodes_m_.begin(), nodes_m_.end(), std::less_equal<>{}));
  if (shape_ == Shape::Cubic) curvature_ = natural_curvature(nodes_m_, values_);
}

ErrorFunction ErrorFunction::polynomial(std::vector<double> coefficients) {
  ErrorFunction f;
  f.coefficients_ = std::move(coefficients);
  return f;
}

ErrorFunction ErrorFunction::with_wave(double amplitude, double period_m) const {
  ErrorFunction f = *this;
  f.wave_amplitude_ = amplitude;
  f.wave_period_m_ = period_m;
  return f;
}

double ErrorFunction::at(double position_m) const {
  double value = nodes_m_.empty() ? 0.0 : between_nodes(position_m);
  double power = 1.0;
  for (const double c : coefficients_) {
    value += c * power;
    power *= position_m;
  }
  if (wave_amplitude_ != 0.0)
    value += wave_amplitude_ * std::sin(2.0 * std::numbers::pi * position_m / wave_period_m_);
  return value;
}

double ErrorFunction::between_nodes(double position_m) const {
  const auto above = std::upper_bound(nodes_m_.begin() + 1, nodes_m_.end() - 1, position_m);
  const auto k = static_cast<std::size_t>(above - nodes_m_.begin()) - 1;
  const double h = nodes_m_[k + 1] - nodes_m_[k];
  const double b = (position_m - nodes_m_[k]) / h;
  const double a = 1.0 - b;
  const double line = a * values_[k] + b * values_[k + 1];
  if (curvature_.empty()) return line;
  return line +
         ((a * a * a - a) * curvature_[k] + (b * b * b - b) * curvature_[k + 1]) * h * h / 6.0;
}

ErrorFunction ErrorFunction::with_values(std::vector<double> values) const {
  return nodes_m_.empty() ? ErrorFunction{} : ErrorFunction(nodes_m_, std::move(values), shape_);
}

}  // namespace abbe::sim
