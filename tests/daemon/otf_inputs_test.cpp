#include "abbe/daemon/otf_inputs.hpp"

#include <gtest/gtest.h>

namespace abbe::daemon {
namespace {

TEST(OtfInputs, TheGateOfTheConfigurationDecidesHowARunIsJudged) {
  const GateConfig gate{.max_error_m = 2e-3, .max_gradient = 1e-2, .holdout_fraction = 0.1};
  EXPECT_EQ(otf_options({}, gate).held_out_folds, 10u);
  EXPECT_EQ(gate_limits(gate).max_error_m, 2e-3);
  EXPECT_EQ(gate_limits(gate).max_gradient, 1e-2);
}

}  // namespace
}  // namespace abbe::daemon
