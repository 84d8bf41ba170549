#pragma once
/// One true error motion as a function of the position of its axis: values on nodes, interpolated
/// linearly or by a natural cubic spline, or a polynomial; a sine wave can be added to both.
/// Outside the nodes the formula of the outermost cell is extrapolated. Pure; safe to share between
/// threads.

#include <span>
#include <vector>

namespace abbe::sim {

enum class Shape { Linear, Cubic };

class ErrorFunction {
 public:
  /// The function that is 0 everywhere.
  ErrorFunction() = default;
  /// Precondition (asserted): `nodes_m` ascending, at least two, one value for each (m for
  /// translations, rad for rotations).
  ErrorFunction(std::vector<double> nodes_m, std::vector<double> values,
                Shape shape = Shape::Linear);

  /// The polynomial sum of coefficient[k] position^k, SI. It has no nodes of a table.
  [[nodiscard]] static ErrorFunction polynomial(std::vector<double> coefficients);
  /// This function plus amplitude sin(2 pi position / period).
  [[nodiscard]] ErrorFunction with_wave(double amplitude, double period_m) const;

  [[nodiscard]] double at(double position_m) const;

  [[nodiscard]] std::span<const double> nodes_m() const { return nodes_m_; }
  [[nodiscard]] std::span<const double> values() const { return values_; }
  [[nodiscard]] Shape shape() const { return shape_; }
  [[nodiscard]] ErrorFunction with_values(std::vector<double> values) const;

 private:
  [[nodiscard]] double between_nodes(double position_m) const;

  std::vector<double> nodes_m_;
  std::vector<double> values_;
  std::vector<double> curvature_;  ///< second derivatives at the nodes; empty when linear
  Shape shape_ = Shape::Linear;
  std::vector<double> coefficients_;
  double wave_amplitude_ = 0.0;
  double wave_period_m_ = 1.0;
};

}  // namespace abbe::sim
