#include "abbe/config/calibration_input.hpp"
#include "abbe/methods/otf/inputs.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "synthetic_otf_run.hpp"

namespace abbe::daemon {
namespace {

using testing::HasSubstr;

MachineConfig machine() {
  return parse_config(test::synthetic_machine_toml(), "machine.toml")->machine;
}

TEST(OtfPath, IsRefusedBeforeTheMachineDrivesIt) {
  const std::vector<AxisPosition> outside{
      {0, 0, 0}, {0.05, 0, 0}, {0.05, 0.07, 0}};  // travel: 60 mm
  const std::vector<AxisPosition> on_a_line{{0, 0, 0}, {0.01, 0, 0}, {0.05, 0, 0}};
  const std::vector<AxisPosition> two_legs{{0, 0, 0}, {0.05, 0, 0}, {0.05, 0.06, 0}};
  for (const auto& [path, what] :
       {std::pair{outside, "axis travels"}, std::pair{on_a_line, "on a line"},
        std::pair{two_legs, "does not determine EXX, EYX"}}) {
    const auto refused = check_otf_path(path, machine());
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, ErrorCode::BadInput);
    EXPECT_THAT(refused.error().text, HasSubstr(what));
  }
}

TEST(OtfPath, ThatCanBeIdentifiedIsTaken) {
  const auto taken = check_otf_path(test::synthetic_request_path_m(), machine());
  EXPECT_TRUE(taken) << taken.error().text;
}

TEST(OtfPath, WithBacklashMustMoveEveryAxis) {
  using enum calib::TravelDependence;
  const std::vector<AxisPosition> flat{{0, 0, 0}, {0.05, 0, 0}, {0.05, 0.05, 0}, {0, 0.05, 0}};
  using calib::otf::Mode;
  EXPECT_TRUE(check_otf_path(flat, machine(), Mode::Standstill, None));
  for (const auto mode : {Mode::Standstill, Mode::OnTheFly}) {
    const auto refused = check_otf_path(flat, machine(), mode, Backlash);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, ErrorCode::BadInput);
    EXPECT_THAT(refused.error().text, HasSubstr("the path does not move Z"));
  }
  EXPECT_TRUE(
      check_otf_path(test::synthetic_request_path_m(), machine(), Mode::OnTheFly, Backlash));
}

TEST(OtfInputs, TheConfigurationNamesTheEstimator) {
  for (const auto estimator : {OtfEstimator::TwoStep, OtfEstimator::Simultaneous}) {
    const OtfConfig otf{.estimator = estimator};
    EXPECT_EQ(otf_options({}, {.machine = machine(), .otf = otf}).estimator, calib_of(estimator));
  }
}

TEST(OtfInputs, TheEarlierWordOfTheEstimatorIsRead) {
  const auto config = [](const std::string& word) {
    return parse_config(test::synthetic_machine_toml() + "[otf]\nestimator = \"" + word + "\"\n",
                        "machine.toml");
  };
  EXPECT_EQ(config("joint")->otf.estimator, OtfEstimator::Simultaneous);
  const auto refused = config("both");
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().details,
              testing::ElementsAre(HasSubstr("must be one of \"two-step\", "
                                             "\"simultaneous\"")));
}

TEST(OtfInputs, TheConfigurationNamesTheFormOfBacklash) {
  using enum calib::TravelDependence;
  EXPECT_EQ(otf_options({}, {.machine = machine(), .otf = {}}).backlash, None);
  for (const auto form : {Backlash, Tables}) {
    const OtfConfig otf{.backlash = config_of(form)};
    EXPECT_EQ(otf_options({}, {.machine = machine(), .otf = otf}).backlash, form);
  }
}

TEST(OtfInputs, TheGateOfTheConfigurationDecidesHowARunIsJudged) {
  const GateConfig gate{.max_error_m = 2e-3, .max_gradient = 1e-2, .holdout_fraction = 0.1};
  EXPECT_EQ(otf_options({}, {.machine = machine(), .gate = gate}).held_out_folds, 10u);
  EXPECT_EQ(gate_limits(gate).max_error_m, 2e-3);
  EXPECT_EQ(gate_limits(gate).max_gradient, 1e-2);
  EXPECT_FALSE(gate_limits(gate).accept_smaller_volume);
  EXPECT_TRUE(gate_limits({.accept = {"smaller-volume"}}).accept_smaller_volume);
  EXPECT_FALSE(gate_limits(gate).accept_scale_change);
  EXPECT_TRUE(gate_limits({.accept = {"scale-change"}}).accept_scale_change);
}

}  // namespace
}  // namespace abbe::daemon
