/// The paths of a measuring machine along a Multi-Feature Bar and a step gauge, beside the
/// simulated bar: the tip reaches every feature and touches nothing on its way.

#include <gmock/gmock.h>

#include <algorithm>

#include "abbe/calib/mfb/plan/pass_on_machine.hpp"
#include "abbe/sim/measuring_machine.hpp"
#include "abbe/sim/mfb/reversal.hpp"
#include "simulated_bar.hpp"

namespace abbe::tests::mfb {
namespace {

using calib::MachineTouch;
using calib::Vector3;
using calib::mfb::PassOnMachine;
using testing::HasSubstr;

constexpr double kTip_m = 1.5e-3;
const Vector3 kFrom_m(0.0, 0.0, 0.3);

/// A normal and a reversed pass, and the bar in each of them.
struct Clampings {
  sim::mfb::TrueBar bar = sim::mfb::random_bar(sim::mfb::reference_pattern(6), {});
  sim::mfb::ReversalOptions options;
  std::vector<sim::mfb::Measurement> measurements;
  calib::mfb::Bar nominal = bar_of(sim::mfb::nominal_bar(bar.pattern, Vector3::Constant(50e-6)));
  calib::mfb::Plan plan;

  Clampings() {
    options.repeats = 1;
    options.tool_offset_m.setZero();
    options.probing.shape_scatter_m = 0.3e-6;
    const auto machine = sim::mfb::measuring_machine(0.0, bar.pattern.length_m(), 1);
    measurements = sim::mfb::reversal_plan(machine, options);
    sim::mfb::ProbedBar probed;
    probed.temperature_C = {20.0, 20.0};
    plan = plan_of(measurements, probed, options.probing);
    plan.noise.machine_m = 0.1e-6;
  }
  [[nodiscard]] sim::mfb::ClampedBar clamped(std::size_t m) const {
    return sim::mfb::clamped(bar, measurements, m, options.probing);
  }
  [[nodiscard]] calib::Result<PassOnMachine> pass(
      std::size_t m, const calib::mfb::MachineTouchOptions& touching = {}) const {
    return calib::mfb::pass_on_machine(nominal, plan, m, kFrom_m, touching);
  }
};

/// The smallest distance of the tip from the bar on the straight ways through `corners`.
double least_clearance_m(const sim::mfb::ClampedBar& clamped, const std::vector<Vector3>& corners) {
  constexpr int kSteps = 40;
  double least_m = 1.0;
  for (std::size_t i = 1; i < corners.size(); ++i)
    for (int step = 0; step <= kSteps; ++step) {
      const Vector3 tip_m =
          corners[i - 1] + (corners[i] - corners[i - 1]) * step / static_cast<double>(kSteps);
      least_m = std::min(least_m, sim::mfb::clearance_m(clamped, tip_m, kTip_m));
    }
  return least_m;
}

TEST(PassOnMachine, TouchesEveryFeatureAndNothingOnTheWay) {
  const Clampings c;
  for (const std::size_t m : {0u, 1u}) {
    const auto pass = c.pass(m);
    ASSERT_TRUE(pass) << pass.error().text;
    ASSERT_EQ(pass->targets.size(), c.bar.pattern.hole_x_m.size() * 8 + 5 * (12 + 8));
    const auto clamped = c.clamped(m);
    std::vector<Vector3> whole{kFrom_m};
    for (const MachineTouch& touch : pass->made.touches) {
      whole.insert(whole.end(), touch.way_m.begin(), touch.way_m.end());
      // 0.2 mm: how the bar is clamped beside the plan.
      EXPECT_NEAR(sim::mfb::clearance_m(clamped, touch.at_m, kTip_m), 0.0, 0.5e-3);
      EXPECT_GT(sim::mfb::clearance_m(clamped, touch.at_m + 2e-3 * touch.normal, kTip_m), 1e-3);
    }
    whole.insert(whole.end(), pass->made.leave_m.begin(), pass->made.leave_m.end());
    EXPECT_GT(least_clearance_m(clamped, whole), 2e-3) << "measurement " << m;
  }
}

TEST(PassOnMachine, BeginsStraightUpAndEndsAtTheTravelHeight) {
  const Clampings c;
  const Vector3 low_m(0.02, 0.1, 0.1);
  const auto pass = calib::mfb::pass_on_machine(c.nominal, c.plan, 0, low_m);
  ASSERT_TRUE(pass) << pass.error().text;
  const auto& way_m = pass->made.touches.front().way_m;
  EXPECT_LT((way_m[0] - low_m).norm(), 1e-12);
  EXPECT_LT((way_m[1] - way_m[0]).head<2>().norm(), 1e-12);
  const double height_m = c.plan.measurements[0].origin_m.z() + 40e-3;
  EXPECT_NEAR(way_m[1].z(), height_m, 1e-12);
  EXPECT_NEAR(pass->made.leave_m.back().z(), height_m, 1e-12);
}

TEST(PassOnMachine, APathWithoutRoomIsRefused) {
  const Clampings c;
  const auto wide = c.pass(0, {.clearance_m = 6.6e-3});
  ASSERT_FALSE(wide);
  EXPECT_THAT(wide.error().text, HasSubstr("at most 6.5 mm in the holes"));
  const auto low = c.pass(0, {.travel_height_m = 10e-3});
  ASSERT_FALSE(low);
  EXPECT_THAT(low.error().text, HasSubstr("must be above 10.5 mm"));
  EXPECT_FALSE(c.pass(0, {.clearance_m = 0.0}));

  Clampings turned;
  turned.plan.measurements[1].bar_z = Vector3::UnitY();
  const auto aside = turned.pass(1);
  ASSERT_FALSE(aside);
  EXPECT_THAT(aside.error().text, HasSubstr("R1: bar_z"));
}

TEST(PassOnMachine, TheGaugeIsTouchedForwardAndBackward) {
  const Clampings c;
  calib::mfb::StepGauge gauge;
  gauge.origin_m = Vector3(0.02, 0.1, 0.1);
  for (const double distance_m : {0.0, 0.025, 0.05})
    gauge.faces.push_back({.distance_m = distance_m, .readings_m = {}});
  const auto touches = calib::mfb::gauge_on_machine(gauge, c.plan.measurements[0], 2, kFrom_m);
  ASSERT_TRUE(touches) << touches.error().text;
  std::vector<double> at_m;
  for (const MachineTouch& touch : touches->touches) {
    at_m.push_back(touch.at_m.x() - gauge.origin_m.x());
    EXPECT_EQ(touch.normal, Vector3(-1.0, 0.0, 0.0));
  }
  EXPECT_THAT(at_m,
              testing::Pointwise(testing::DoubleNear(1e-12), {0.0, 0.025, 0.05, 0.05, 0.025, 0.0}));
  EXPECT_FALSE(calib::mfb::gauge_on_machine(gauge, c.plan.measurements[0], 0, kFrom_m));
}

/// The same touches on the lines of the plan.
TEST(BarOnTable, ProbingOverTheMachineFindsTheSurfacesOfTheBar) {
  Clampings c;
  c.options.probing.clamping_m = c.options.probing.clamping_rad = 0.0;
  c.options.probing.machine_noise_m = 0.0;
  c.options.probing.probe = {
      .tip_radius_m = kTip_m, .noise_m = 0.0, .lobing_m = 0.0, .delay_s = 0.0};
  c.options.probing.sag = sim::mfb::reference_sag(c.bar.pattern);
  const auto truth = sim::mfb::measuring_machine(2e-6, c.bar.pattern.length_m(), 1);
  const auto probed = sim::mfb::probe_bar(truth, c.bar, c.measurements, c.options.probing);
  ASSERT_TRUE(probed) << probed.error().text;

  sim::MeasuringMachine machine{.truth = truth};
  machine.tip_radius_m = kTip_m;
  std::size_t measurement = 99;
  for (const sim::mfb::Touch& touch : probed->touches) {
    if (touch.measurement != measurement) {
      measurement = touch.measurement;
      machine.bar = c.clamped(measurement);
    }
    const auto found = sim::probe(machine, touch.reading_m, touch.normal, 0);
    ASSERT_FALSE(found.fault);
    // The clamping bends the bar by some 10 um per m, here at the centre of the tip, there at the
    // touched place 1.5 mm away.
    EXPECT_LT((found.reading_m - touch.reading_m).norm(), 50e-9) << sim::mfb::name(touch.target);
  }
}

}  // namespace
}  // namespace abbe::tests::mfb
