#include <gtest/gtest.h>

#include <cmath>

#include "abbe/calib/evemu/solve/solve.hpp"
#include "allocation_count.hpp"
#include "evemu_run.hpp"

namespace abbe::calib::evemu {
namespace {

TEST(PolynomialModel, PredictsWithUncertaintyWithoutTakingMemory) {
  const auto observations =
      observe_errors(tests::evemu::reference_errors(), tests::evemu::reference_machine());
  const auto solution = solve(*observations);
  ASSERT_TRUE(solution);
  const Vector3 tool_m = Vector3::Zero();
  double sum = 0.0;
  const tests::AllocationCount count;

  for (int i = 0; i < 1000; ++i) {
    const VolumetricError e = solution->model.error_at({0.001 * i - 0.1, 0.2, 0.05}, tool_m);
    sum += e.V_m.x() + e.cov_V_m2(0, 0);
  }

  EXPECT_EQ(count.value(), 0u);
  EXPECT_TRUE(std::isfinite(sum));
}

}  // namespace
}  // namespace abbe::calib::evemu
