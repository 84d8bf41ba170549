// A short version of the campaign of scripts/soak never-worse with a Multi-Feature Bar: one
// machine, some faults.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "mfb_run.hpp"

namespace {
using namespace abbe::tests::never_worse;

Outcome with_fault(const std::string& name, std::uint64_t seed) {
  for (const Fault<MfbRun>& fault : mfb_faults()) {
    if (fault.name == name) {
      MfbRun run = random_mfb_run(seed);
      fault.put_in(run);
      return identify_and_compare_mfb(std::move(run));
    }
  }
  ADD_FAILURE() << "there is no fault " << name;
  return {};
}

constexpr std::uint64_t kSeed = 2;  // 17 passes

TEST(NeverWorseBar, ASoundRunIsAcceptedAndTheModelIsInsideItsUncertainty) {
  const Outcome o = with_fault("none", kSeed);
  EXPECT_TRUE(o.accepted) << o.first_reason;
  EXPECT_LT(o.left_m, o.u_m);
  EXPECT_GT(o.before_m, 5.0 * o.left_m);
}

TEST(NeverWorseBar, ABarThatMovesIsRefused) {
  const Outcome o = with_fault("bar shifted by 5..50 um within a pass", kSeed);
  EXPECT_FALSE(o.accepted);
  EXPECT_THAT(o.first_cause, testing::AnyOf("measurement", "drift", "outliers"));
}

TEST(NeverWorseBar, AMovedHoleIsNamed) {
  const Outcome o = with_fault("hole moved by 10..200 um since the calibration", kSeed);
  EXPECT_FALSE(o.accepted);
  EXPECT_EQ(o.first_cause, "hole") << o.first_reason;
}

TEST(NeverWorseBar, DegreesFahrenheitAreAskedForByName) {
  const Outcome o = with_fault("bar's temperature in degrees Fahrenheit", kSeed);
  EXPECT_FALSE(o.accepted);
  EXPECT_THAT(o.first_reason, testing::HasSubstr("check temperature_C, in degrees Celsius"));
}

TEST(NeverWorseBar, ErrorsBetweenTheNodesAreRefused) {
  const Outcome o = with_fault("waves of 2..20 um, 60 mm", kSeed);
  EXPECT_FALSE(o.accepted);
  EXPECT_THAT(o.first_cause, testing::AnyOf("unknown", "measurement", "drift", "hole"))
      << o.first_reason;
}

}  // namespace
