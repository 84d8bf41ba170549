#include "abbe/drivers/sampling/coverage.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace abbe::tests {
namespace {

using drivers::expanded_95;

TEST(Expanded95, IsThatOfANormalAlone) {
  EXPECT_NEAR(expanded_95(0.0, 2.0), 2.0 * 1.959964, 1e-5);
}

TEST(Expanded95, IsThatOfARectangleAlone) {
  EXPECT_NEAR(expanded_95(2.0, 0.0), 1.9, 1e-12);
}

TEST(Expanded95, IsZeroForNothing) {
  EXPECT_EQ(expanded_95(0.0, 0.0), 0.0);
}

TEST(Expanded95, HasItsStatedCoverageForEveryMixture) {
  std::mt19937 random(9);
  for (const double half_width : {0.05, 0.5, 1.0, 3.0, 20.0}) {
    const double U = expanded_95(half_width, 1.0);
    std::uniform_real_distribution<double> rectangle{-half_width, half_width};
    std::normal_distribution<double> normal;
    constexpr int kDraws = 100'000;
    int held = 0;
    for (int i = 0; i < kDraws; ++i)
      held += std::abs(rectangle(random) + normal(random)) <= U ? 1 : 0;
    EXPECT_NEAR(static_cast<double>(held) / kDraws, 0.95, 4 * std::sqrt(0.95 * 0.05 / kDraws))
        << half_width;
  }
}

}  // namespace
}  // namespace abbe::tests
