#include "abbe/calib/environment/refractive_index.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

namespace abbe::calib {
namespace {

Air air(double t_C, double p_Pa, double rh_percent) {
  return {
      .temperature_K = t_C + 273.15, .pressure_Pa = p_Pa, .relative_humidity = rh_percent / 100.0};
}
double index_of(const Air& a, IndexEquation equation) {
  return refractive_index(a, kHeliumNeon_m, equation).value().n;
}

struct Row {
  double t_C, p_Pa, rh_percent, ciddor, edlen, shop;
};

// 633 nm, 450 ppm CO2; computed by an independent program, agrees with the printed values of
// [Ciddor 1996].
constexpr Row kTable[]{{20, 101325, 0, 1.000271800, 1.000271799, 1.0002718},
                       {20, 101325, 50, 1.000271373, 1.000271374, 1.0002714},
                       {20, 60000, 0, 1.000160924, 1.000160920, 1.0001610},
                       {20, 80000, 75, 1.000213940, 1.000213940, 1.0002140},
                       {25, 98000, 40, 1.000258002, 1.000258003, 1.0002580},
                       {18, 101325, 50, 1.000273293, 1.000273294, 1.0002733},
                       {5, 100000, 100, 1.000282421, 1.000282416, 1.0002825},
                       {50, 100000, 0, 1.000243285, 1.000243270, 1.0002433}};

class IndexTable : public testing::TestWithParam<Row> {};

TEST_P(IndexTable, IsReproducedToOnePartInABillion) {
  const Row& row = GetParam();
  const Air a = air(row.t_C, row.p_Pa, row.rh_percent);
  EXPECT_NEAR(index_of(a, IndexEquation::Ciddor), row.ciddor, 1e-9);
  EXPECT_NEAR(index_of(a, IndexEquation::Edlen), row.edlen, 1e-9);
  EXPECT_NEAR(index_of(a, IndexEquation::ShopFloor), row.shop,
              0.51e-7);  // printed with seven digits
}

INSTANTIATE_TEST_SUITE_P(RefractiveIndex, IndexTable, testing::ValuesIn(kTable));

TEST(RefractiveIndex, AgreesWithTheDryAirOfThePaper) {
  // [Ciddor 1996] table 1: (n - 1) x 1e8 at 633 nm and 450 ppm, one digit after the point.
  EXPECT_NEAR((index_of(air(20, 80'000, 0), IndexEquation::Ciddor) - 1.0) * 1e8, 21458.0, 0.06);
  EXPECT_NEAR((index_of(air(20, 100'000, 0), IndexEquation::Ciddor) - 1.0) * 1e8, 26824.4, 0.06);
  EXPECT_NEAR((index_of(air(20, 120'000, 0), IndexEquation::Ciddor) - 1.0) * 1e8, 32191.6, 0.06);
  EXPECT_NEAR((index_of(air(10, 100'000, 0), IndexEquation::Ciddor) - 1.0) * 1e8, 27774.7, 0.06);
  EXPECT_NEAR((index_of(air(30, 100'000, 0), IndexEquation::Ciddor) - 1.0) * 1e8, 25937.2, 0.06);
}

struct Co2Row {
  double t_C, p_Pa, rh_percent, co2_ppm, n;
};

// 633 nm; computed with M. Polyanskiy's program of [Ciddor 1996] (refractiveindex.info), which uses
// another vapour pressure equation.
constexpr Co2Row kCo2Table[]{
    {20, 101325, 50, 0, 1.0002713082},   {20, 101325, 50, 400, 1.0002713656},
    {20, 101325, 0, 1000, 1.0002718797}, {20, 101325, 50, 1000, 1.0002714516},
    {25, 98000, 40, 1000, 1.0002580765}, {18, 101325, 50, 2000, 1.0002735170}};

class Co2Table : public testing::TestWithParam<Co2Row> {};

TEST_P(Co2Table, IsReproducedByBothGreatEquations) {
  Air a = air(GetParam().t_C, GetParam().p_Pa, GetParam().rh_percent);
  a.co2_ppm = GetParam().co2_ppm;
  EXPECT_NEAR(index_of(a, IndexEquation::Ciddor), GetParam().n, 1e-9);
  EXPECT_NEAR(index_of(a, IndexEquation::Edlen), GetParam().n,
              5e-9);  // the equations agree to 4e-9
}

INSTANTIATE_TEST_SUITE_P(RefractiveIndex, Co2Table, testing::ValuesIn(kCo2Table));

// 1 ppm of CO2 is 0.534e-6 of n - 1 = 2.7e-4 [Ciddor 1996], [Bonsch & Potulski 1998]: 1.45e-10.
TEST(RefractiveIndex, StatesTheUncertaintyOfCo2ForEveryEquation) {
  Air a = air(20, 101'325, 50);
  a.u_co2_ppm = 200.0;
  for (const auto equation :
       {IndexEquation::Ciddor, IndexEquation::Edlen, IndexEquation::ShopFloor}) {
    const double expected = std::hypot(u_of_equation(equation), 200.0 * 1.45e-10);
    EXPECT_NEAR(refractive_index(a, kHeliumNeon_m, equation)->u_n, expected, 0.01 * expected);
  }
}

TEST(RefractiveIndex, CountsTheCo2ThatAFormulaLeavesOut) {
  Air a = air(20, 101'325, 50);
  a.co2_ppm = 1000.0;
  const auto u_n = [&a](IndexEquation e) { return refractive_index(a, kHeliumNeon_m, e)->u_n; };
  EXPECT_NEAR(u_n(IndexEquation::ShopFloor), std::hypot(1.5e-7, 7.9e-8), 2e-9);
  EXPECT_DOUBLE_EQ(u_n(IndexEquation::Edlen), u_of_equation(IndexEquation::Edlen));
}

// Root mean square of n - n(20 C, 1013.25 hPa, 50 %) over the range of shop-floor air, by
// quadrature with the program of Co2Table: 1.0443e-5. n is not linear over 15 K: 1 %.
TEST(AssumedAir, IsUncertainByWhatAShopFloorCanBe) {
  const double u =
      u_of_assumed_air(air(20, 101'325, 50), kHeliumNeon_m, IndexEquation::Ciddor).value();
  EXPECT_NEAR(u / 1.0443e-5, 1.0, 0.015);
  EXPECT_FALSE(u_of_assumed_air(air(-5, 101'325, 50), kHeliumNeon_m, IndexEquation::Ciddor));
}

TEST(RefractiveIndex, IsThatOfTheVapourPressureOfWater) {
  EXPECT_NEAR(saturation_vapour_pressure_Pa(293.15), 2339.21, 0.01);
}

TEST(RefractiveIndex, TellsPartsPerMillionPerUnit) {
  const Air a = air(20, 101'325, 50);
  const auto slope_ppm = [&](Air changed) {
    return (index_of(changed, IndexEquation::Ciddor) - index_of(a, IndexEquation::Ciddor)) * 1e6;
  };
  EXPECT_NEAR(slope_ppm(air(20.01, 101'325, 50)) / 0.01, -0.952, 0.005);
  EXPECT_NEAR(slope_ppm(air(20, 101'425, 50)), 0.268, 0.001);
  EXPECT_NEAR(slope_ppm(air(20, 101'325, 51)), -0.0085, 0.0002);
}

TEST(RefractiveIndex, HasTheEquationsUncertaintyInPerfectlyKnownAir) {
  for (const auto equation :
       {IndexEquation::Ciddor, IndexEquation::Edlen, IndexEquation::ShopFloor}) {
    EXPECT_DOUBLE_EQ(refractive_index(air(20, 101'325, 50), kHeliumNeon_m, equation)->u_n,
                     u_of_equation(equation));
  }
}

TEST(RefractiveIndex, StatesTheScatterThatUncertainAirCauses) {
  Air a = air(22, 99'000, 40);
  a.u_temperature_K = 0.2;
  a.u_pressure_Pa = 30.0;
  a.u_relative_humidity = 0.03;
  a.u_co2_ppm = 100.0;
  const auto stated = refractive_index(a, kHeliumNeon_m, IndexEquation::Ciddor).value();
  std::mt19937 random{1};
  std::normal_distribution<double> unit;
  constexpr int kDraws = 20'000;
  double sum2 = 0.0;

  for (int i = 0; i < kDraws; ++i) {
    Air drawn = a;
    drawn.temperature_K += a.u_temperature_K * unit(random);
    drawn.pressure_Pa += a.u_pressure_Pa * unit(random);
    drawn.relative_humidity += a.u_relative_humidity * unit(random);
    drawn.co2_ppm += a.u_co2_ppm * unit(random);
    const double d = index_of(drawn, IndexEquation::Ciddor) - stated.n;
    sum2 += d * d;
  }

  const double scatter = std::sqrt(sum2 / kDraws);
  const double u_air = std::sqrt(stated.u_n * stated.u_n - 1.5e-8 * 1.5e-8);
  EXPECT_NEAR(u_air / scatter, 1.0, 0.02);  // the sampled scatter is accurate to 0.5 %
}

TEST(RefractiveIndex, RefusesAirThatIsNone) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const Air& a :
       {air(-5, 101'325, 50), air(20, 20'000, 50), air(20, 101'325, 120), air(nan, 101'325, 50)}) {
    const auto n = refractive_index(a, kHeliumNeon_m, IndexEquation::Ciddor);
    ASSERT_FALSE(n);
    EXPECT_EQ(n.error().code, ErrorCode::BadInput);
  }
  EXPECT_FALSE(refractive_index(air(20, 101'325, 50), 633.0, IndexEquation::Ciddor));
}

TEST(RefractiveIndex, ShortensADistanceInDenserAir) {
  const double n0 = index_of(air(20, 101'325, 50), IndexEquation::Ciddor);
  const double n = index_of(air(15, 101'325, 50), IndexEquation::Ciddor);
  // 10 m, 5 K colder: about 0.95 ppm per kelvin.
  EXPECT_NEAR(10.0 * distance_factor(n0, n) - 10.0, -10.0 * 5 * 0.96e-6, 1e-6);
}

}  // namespace
}  // namespace abbe::calib
