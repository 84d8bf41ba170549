#include "abbe/calib/environment/thermal_expansion.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace abbe::calib {
namespace {

Expansion steel(double t_C) {
  return {11.5e-6, 1e-6, t_C + 273.15, 0.1};
}
Expansion glass(double t_C) {
  return {8e-6, 0.5e-6, t_C + 273.15, 0.1};
}

TEST(ThermalExpansion, MakesAMetreOfSteelLongerByElevenMicrometresPerKelvin) {
  EXPECT_NEAR(expansion_factor(steel(21.0)) - 1.0, 11.5e-6, 1e-15);
}

TEST(ThermalExpansion, LeavesEverythingAsItIsAtTwentyDegrees) {
  EXPECT_EQ(expansion_factor(steel(20.0)), 1.0);
  EXPECT_EQ(true_position(0.7, 0.2, glass(20.0)).value_m, 0.7);
}

TEST(ThermalExpansion, MovesAnAxisFartherThanAWarmScaleReads) {
  EXPECT_NEAR(true_position(1.0, 0.0, glass(23.0)).value_m - 1.0, 24e-6, 1e-12);
  EXPECT_NEAR(true_position(-1.0, 0.0, glass(23.0)).value_m + 1.0, -24e-6, 1e-12);
}

TEST(ThermalExpansion, LeavesTheFixedPointOfAScaleWhereItIs) {
  const auto p = true_position(0.4, 0.4, glass(28.0));
  EXPECT_EQ(p.value_m, 0.4);
  EXPECT_EQ(p.u_m, 0.0);
}

TEST(ThermalExpansion, KeepsTheUncertaintyOfAnUncertainTemperatureAtTwentyDegrees) {
  EXPECT_NEAR(true_position(1.0, 0.0, steel(20.0)).u_m, 11.5e-6 * 0.1, 1e-15);
}

TEST(ThermalExpansion, StatesTheScatterThatItsUncertaintiesCause) {
  const Expansion scale = glass(24.0);
  const auto stated = true_position(0.8, 0.1, scale);
  std::mt19937 random{2};
  std::normal_distribution<double> unit;

  const auto drawn = [&](Expansion e) {
    e.alpha_per_K += e.u_alpha_per_K * unit(random);
    e.temperature_K += e.u_temperature_K * unit(random);
    return e;
  };

  constexpr int kDraws = 20'000;
  double sum2 = 0.0;
  for (int i = 0; i < kDraws; ++i) {
    const double d = true_position(0.8, 0.1, drawn(scale)).value_m - stated.value_m;
    sum2 += d * d;
  }

  // the sampled scatter is accurate to 0.5 %
  EXPECT_NEAR(stated.u_m / std::sqrt(sum2 / kDraws), 1.0, 0.02);
}

}  // namespace
}  // namespace abbe::calib
