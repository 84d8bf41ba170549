#include "abbe/calib/geometry/axis_interpolation.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

namespace {
using namespace abbe::calib;

const std::vector<double> kNodes_m{-0.3, -0.26, -0.17, -0.05, 0.0, 0.08, 0.1};  // unequal cells

double value_at(const AxisInterpolation& axis, const std::vector<double>& U, double q) {
  const NodeWeights w = axis.at(q);
  double sum = 0.0;
  for (std::size_t i = 0; i < w.count(); ++i) {
    sum += w[i] * U[w.first() + i];
  }
  return sum;
}

std::vector<double> at_nodes(const std::vector<double>& nodes_m,
                             const std::function<double(double)>& f) {
  std::vector<double> U;
  for (const double x : nodes_m) {
    U.push_back(f(x));
  }
  return U;
}

/// Second derivative by differences within the cell of q.
double curvature_at(const AxisInterpolation& axis, const std::vector<double>& U, double q) {
  constexpr double h = 1e-3;
  return (value_at(axis, U, q + h) - 2.0 * value_at(axis, U, q) + value_at(axis, U, q - h)) /
         (h * h);
}

class EveryInterpolation : public testing::TestWithParam<Interpolation> {
 protected:
  AxisInterpolation axis_ = *AxisInterpolation::of(kNodes_m, GetParam());
};
INSTANTIATE_TEST_SUITE_P(Kinds, EveryInterpolation,
                         testing::Values(Interpolation::Linear, Interpolation::NaturalCubic,
                                         Interpolation::NotAKnotCubic),
                         [](const auto& kind) {
                           std::string text(name(kind.param));
                           std::erase(text, '-');
                           return text;
                         });

TEST_P(EveryInterpolation, GivesTheValuesAtTheNodes) {
  const std::vector<double> U = at_nodes(kNodes_m, [](double x) { return std::sin(9.0 * x); });
  for (std::size_t i = 0; i < U.size(); ++i) {
    EXPECT_NEAR(value_at(axis_, U, kNodes_m[i]), U[i], 1e-15);
  }
}

TEST_P(EveryInterpolation, ReproducesStraightLinesInsideAndOutside) {
  const auto line = [](double x) { return 3.0 - 2.0 * x; };
  const std::vector<double> U = at_nodes(kNodes_m, line);
  for (const double q : {-0.35, -0.3, -0.28, -0.1, 0.03, 0.1, 0.13}) {
    EXPECT_NEAR(value_at(axis_, U, q), line(q), 1e-14) << q;
  }
}

TEST_P(EveryInterpolation, HasAtMostTheStatedNumberOfWeights) {
  for (const double q : {-0.4, -0.3, -0.2, 0.0, 0.1, 0.2}) {
    const NodeWeights w = axis_.at(q);
    EXPECT_LE(w.count(), axis_.most_weights());
    EXPECT_LE(w.first() + w.count(), axis_.size());
  }
}

class EveryCubic : public EveryInterpolation {};
INSTANTIATE_TEST_SUITE_P(Kinds, EveryCubic,
                         testing::Values(Interpolation::NaturalCubic,
                                         Interpolation::NotAKnotCubic));

/// Second derivative at a node from the cell on one side, in which it is linear.
double curvature_beside(const AxisInterpolation& axis, const std::vector<double>& U, double node,
                        double side) {
  constexpr double d = 2e-3;
  return 2.0 * curvature_at(axis, U, node + side * d) -
         curvature_at(axis, U, node + side * 2.0 * d);
}

TEST_P(EveryCubic, HasContinuousFirstAndSecondDerivatives) {
  const std::vector<double> U = at_nodes(kNodes_m, [](double x) { return std::sin(9.0 * x); });
  constexpr double h = 1e-5;
  for (std::size_t i = 1; i + 1 < kNodes_m.size(); ++i) {
    const double x = kNodes_m[i];
    const double before = (value_at(axis_, U, x) - value_at(axis_, U, x - h)) / h;
    const double after = (value_at(axis_, U, x + h) - value_at(axis_, U, x)) / h;
    EXPECT_NEAR(after, before, 100.0 * h) << x;  // U'' h, with U'' up to 81
    EXPECT_NEAR(curvature_beside(axis_, U, x, -1.0), curvature_beside(axis_, U, x, 1.0), 1e-7) << x;
  }
}

TEST(NaturalCubic, IsStraightAtBothEnds) {
  const auto axis = AxisInterpolation::of(kNodes_m, Interpolation::NaturalCubic);
  const std::vector<double> U = at_nodes(kNodes_m, [](double x) { return x * x; });
  // U'' is linear in a cell and zero at the end: at the distance d it is d times the slope.
  const double d1 = curvature_at(*axis, U, -0.298), d2 = curvature_at(*axis, U, -0.296);
  EXPECT_NEAR(d2, 2.0 * d1, 1e-7);
  EXPECT_GT(d1, 0.01);
}

TEST(NotAKnotCubic, ReproducesCubicPolynomialsInsideAndOutside) {
  const auto axis = AxisInterpolation::of(kNodes_m, Interpolation::NotAKnotCubic);
  const auto cubic = [](double x) { return ((4.0 * x - 3.0) * x + 2.0) * x - 1.0; };
  const std::vector<double> U = at_nodes(kNodes_m, cubic);
  for (const double q : {-0.35, -0.28, -0.2, -0.01, 0.05, 0.09, 0.12}) {
    EXPECT_NEAR(value_at(*axis, U, q), cubic(q), 1e-14) << q;
  }
}

TEST(NotAKnotCubic, OfThreeNodesIsAParabola) {
  const std::vector<double> nodes{0.0, 0.1, 0.3};
  const auto axis = AxisInterpolation::of(nodes, Interpolation::NotAKnotCubic);
  const auto parabola = [](double x) { return 1.0 + (5.0 * x - 2.0) * x; };
  for (const double q : {0.05, 0.2, 0.4}) {
    EXPECT_NEAR(value_at(*axis, at_nodes(nodes, parabola), q), parabola(q), 1e-15);
  }
}

TEST(AxisInterpolation, OfTwoNodesIsAStraightLine) {
  for (const auto kind : {Interpolation::NaturalCubic, Interpolation::NotAKnotCubic}) {
    const auto axis = AxisInterpolation::of(std::vector{0.0, 0.2}, kind);
    EXPECT_DOUBLE_EQ(value_at(*axis, {1.0, 3.0}, 0.05), 1.5);
  }
}

TEST(AxisInterpolation, RefusesTooManyNodesOfACubic) {
  std::vector<double> nodes;
  for (std::size_t i = 0; i <= AxisInterpolation::kMostCubicNodes; ++i) {
    nodes.push_back(static_cast<double>(i));
  }
  EXPECT_TRUE(AxisInterpolation::of(nodes, Interpolation::Linear));
  const auto axis = AxisInterpolation::of(nodes, Interpolation::NaturalCubic);
  ASSERT_FALSE(axis);
  EXPECT_EQ(axis.error().code, ErrorCode::BadInput);
}

}  // namespace
