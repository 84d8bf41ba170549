/// A ball array on a machine whose errors have waves that polynomials do not follow.
#include <gtest/gtest.h>

#include <cmath>

#include "evemu_run.hpp"
#include "repetitions.hpp"

namespace abbe::tests::never_worse {
namespace {

TEST(EvemuMisfit, WavesThatPolynomialsDoNotFollowAreInU) {
  EvemuRun run = random_evemu_run(1);
  run.more_error_m = [](const Vector3& q_m) -> Vector3 {
    constexpr double kSize_m = 3e-6, kLength_m = 0.03;
    return kSize_m * (2.0 * M_PI / kLength_m * q_m.array()).sin().matrix();
  };
  const Outcome waves = identify_and_compare_evemu(run);
  EXPECT_GT(waves.misfit_m, 1e-6);
  EXPECT_GE(static_cast<double>(waves.below_U), 0.93 * static_cast<double>(waves.places));
}

TEST(EvemuMisfit, NoneOnASoundMachine) {
  for (std::uint64_t seed = 1; seed <= repetitions(std::uint64_t{3}); ++seed) {
    EXPECT_EQ(identify_and_compare_evemu(random_evemu_run(seed)).misfit_m, 0.0) << seed;
  }
}

}  // namespace
}  // namespace abbe::tests::never_worse
