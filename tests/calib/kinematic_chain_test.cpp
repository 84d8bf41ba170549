#include "abbe/calib/geometry/kinematic_chain.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace {
using namespace abbe::calib;
using testing::ElementsAre;
using testing::HasSubstr;

std::string refusal(std::string_view chain) {
  const Result<KinematicChain> parsed = KinematicChain::parse(chain);
  return parsed ? "accepted" : parsed.error().text;
}

TEST(KinematicChain, ReadsTheOrderOfTheReferenceMachine) {
  const Result<KinematicChain> chain = KinematicChain::parse("[w X' b Y Z (C1) t]");
  ASSERT_TRUE(chain) << chain.error().text;
  EXPECT_THAT(chain->order_w_to_t(), ElementsAre(Axis::X, Axis::Y, Axis::Z));
}

TEST(KinematicChain, ReadsAnyOrderOfTheThreeAxes) {
  const Result<KinematicChain> chain = KinematicChain::parse("[w Y' Z' b X t]");
  ASSERT_TRUE(chain) << chain.error().text;
  EXPECT_THAT(chain->order_w_to_t(), ElementsAre(Axis::Y, Axis::Z, Axis::X));
  EXPECT_EQ(chain->place(Axis::X), 2u);
}

TEST(KinematicChain, IgnoresAxesThatDoNotMoveAndSpindles) {
  const Result<KinematicChain> chain = KinematicChain::parse("[w (C2') A' X' b Y Z S t]");
  ASSERT_TRUE(chain) << chain.error().text;
  EXPECT_THAT(chain->order_w_to_t(), ElementsAre(Axis::X, Axis::Y, Axis::Z));
}

TEST(KinematicChain, SaysWhatIsBroken) {
  EXPECT_THAT(refusal("w X b Y Z t"), HasSubstr("brackets"));
  EXPECT_THAT(refusal("[X b Y Z t]"), HasSubstr("begin with w"));
  EXPECT_THAT(refusal("[w X' Y Z t]"), HasSubstr("0 b"));
  EXPECT_THAT(refusal("[w X b Y Z t]"), HasSubstr("must be primed"));
  EXPECT_THAT(refusal("[w X' b Y' Z t]"), HasSubstr("must not be primed"));
  EXPECT_THAT(refusal("[w X' b Y Y t]"), HasSubstr("twice"));
  EXPECT_THAT(refusal("[w X' b Y t]"), HasSubstr("2 of them"));
  EXPECT_THAT(refusal("[w X' b Y (Z) t]"), HasSubstr("must move"));
  EXPECT_THAT(refusal("[w X' b Y ? t]"), HasSubstr("\"?\""));
  EXPECT_THAT(refusal(""), HasSubstr("brackets"));
}

}  // namespace
