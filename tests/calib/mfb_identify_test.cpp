#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <random>

#include "mfb_simulation.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::mfb;
using namespace abbe::tests::mfb;
using testing::HasSubstr;
using testing::StartsWith;

/// A simulated machine, its plan and its touches.
struct Probed {
  std::mt19937_64 random;
  SimulatedMachine machine;
  Plan plan;
  ProbedBar probed;

  explicit Probed(unsigned seed, const ProbingOptions& options = {}, const Plan& of = paper_plan())
      : random(seed), machine(random), plan(of), probed(probe(machine, plan, random, options)) {}

  [[nodiscard]] Result<Identification> identified(const Options& options = {}) const {
    return identify(probed.bar, plan, probed.touches, paper_machine(), options);
  }
  /// "" if the touches are identified.
  [[nodiscard]] std::string refusal() const {
    const auto found = identified();
    return found ? "" : found.error().text;
  }
  [[nodiscard]] std::size_t number_of(const std::string& name) const {
    for (std::size_t m = 0; m < plan.measurements.size(); ++m) {
      if (plan.measurements[m].name == name) {
        return m;
      }
    }
    return 0;
  }
  PassTouches& pass(const std::string& name) { return probed.touches[number_of(name)]; }
  Touch& touch(const std::string& name, const Target& target) {
    PassTouches& touches = pass(name);
    return *std::find_if(touches.begin(), touches.end(),
                         [&](const Touch& t) { return t.target == target; });
  }
  /// Moves a touch along the outward normal.
  void displace(const std::string& name, const Target& target, double by_m) {
    const auto nominal = nominal_touches(probed.bar.pattern, 0.0);
    const Matrix3 axes = plan.measurements[number_of(name)].axes();
    touch(name, target).reading_m +=
        by_m * axes * nominal[*probed.bar.pattern.place_of(target)].outward;
  }
};

const Probed& usual() {
  static const Probed probed(21);
  return probed;
}

/// Rms of the differences to the truth [um or urad], and the mean of their squares over u^2.
struct Agreement {
  double translation_um = 0.0, rotation_urad = 0.0, mean_square = 0.0;
};
Agreement agreement(const Identification& found, const SimulatedMachine& machine) {
  const ParameterLayout& layout = found.observations.basis.layout();
  const Eigen::VectorXd off = found.solution.U - machine.truth(layout);
  Agreement a;
  double translations = 0.0, rotations = 0.0;
  const auto parameters = found.model.parameters();
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    if (parameters[i].u > 0.0) {
      const double d = off(static_cast<Eigen::Index>(i));
      const bool angle = parameters[i].is_angle();
      (angle ? a.rotation_urad : a.translation_um) += 1e12 * d * d;
      (angle ? rotations : translations) += 1.0;
      a.mean_square += d * d / (parameters[i].u * parameters[i].u);
    }
  }
  a.mean_square /= translations + rotations;
  a.translation_um = std::sqrt(a.translation_um / translations);
  a.rotation_urad = std::sqrt(a.rotation_urad / rotations);
  return a;
}

TEST(MfbIdentify, FindsTheErrorsWithoutNoise) {
  const Probed p(5, {.noise = 1e-3, .calibration = 0.0});
  const auto found = p.identified();
  ASSERT_TRUE(found) << found.error().text;
  const Agreement a = agreement(*found, p.machine);
  EXPECT_LT(a.translation_um, 0.02);  // errors between the nodes, and what the rows neglect
  EXPECT_LT(a.rotation_urad, 0.05);
  EXPECT_TRUE(found->set_aside.empty());
  EXPECT_EQ(found->model.interpolation(), Interpolation::NotAKnotCubic);
}

TEST(MfbIdentify, StatesItsUncertainty) {
  double mean_square = 0.0, translation_um = 0.0;
  constexpr int kMachines = 3;
  for (unsigned seed = 30; seed < 30 + kMachines; ++seed) {
    const Probed p(seed);
    const auto found = p.identified();
    ASSERT_TRUE(found) << found.error().text;
    EXPECT_LT(found->solution.statistics.chi2_per_dof,
              found->solution.statistics.chi2_per_dof_limit);
    EXPECT_EQ(found->cause.cause, Cause::None) << found->cause.text;
    mean_square += agreement(*found, p.machine).mean_square / kMachines;
    translation_um += agreement(*found, p.machine).translation_um / kMachines;
  }
  EXPECT_NEAR(mean_square, 1.0, 0.25);  // 3 machines with about 60 independent parameters each
  EXPECT_LT(translation_um, 0.26);
}

TEST(MfbIdentify, ModelHoldsForEveryToolAndPredictsTheError) {
  const Probed& p = usual();
  const auto found = p.identified();
  ASSERT_TRUE(found) << found.error().text;
  const VolumetricModel& model = found->model;
  EXPECT_TRUE(model.holds_for_tool(Vector3(0.05, -0.03, -0.2)));
  // Of two places with one tool the difference of V does not depend on the motion of the bar.
  const Vector3 tool(0.0, 0.0, -0.15), q1(0.1, 0.15, 0.2), q2(0.45, 0.4, 0.3);
  const auto V_true = [&](const Vector3& q) {
    return Vector3(p.machine.tip_m(q, tool) - q - tool);
  };
  const Vector3 off = model.V_at(q2, tool) - model.V_at(q1, tool) - (V_true(q2) - V_true(q1));
  EXPECT_LT(off.norm(), 2e-6);
  EXPECT_GT((V_true(q2) - V_true(q1)).norm(), 5e-6);
  EXPECT_TRUE(model.error_at(q1, tool).inside);
}

TEST(MfbIdentify, EstimatesTheDriftOfPairs) {
  const Probed p(41, {.drift_m = 2e-6}, with_pairs(paper_plan()));
  const auto found = p.identified();
  ASSERT_TRUE(found) << found.error().text;
  const Agreement a = agreement(*found, p.machine);
  EXPECT_LT(a.translation_um, 0.21);  // 0.16 in the mean of many machines
  EXPECT_NEAR(found->solution.statistics.chi2_per_dof, 1.0, 0.2);
  ASSERT_EQ(found->solution.drift.size(), 17u);
  for (const PairDrift& drift : found->solution.drift) {
    EXPECT_NEAR(drift.rate_m.norm(), 2e-6, 5.0 * drift.u_rate_m.norm()) << drift.forward;
    EXPECT_EQ(drift.backward, drift.forward + " back");
  }
}

TEST(MfbIdentify, NamesDriftAsTheCauseOfForwardPassesAlone) {
  const Probed p(42, {.drift_m = 3e-6});
  const auto found = p.identified();
  ASSERT_TRUE(found) << found.error().text;
  EXPECT_EQ(found->cause.cause, Cause::Drift) << found->cause.text;
  EXPECT_THAT(found->cause.text, HasSubstr("forward and backward"));
}

TEST(MfbIdentify, NamesAHoleThatIsNotWhereItWasCalibrated) {
  Probed p(43);
  p.probed.bar.O_m[6] += Vector3(0.0, 8e-6, 0.0);
  const auto found = p.identified();
  ASSERT_TRUE(found) << found.error().text;
  EXPECT_EQ(found->cause.cause, Cause::Hole) << found->cause.text;
  EXPECT_THAT(found->cause.text, HasSubstr("hole 7"));
}

TEST(MfbIdentify, NamesAMeasurementDuringWhichTheBarMoved) {
  Probed p(44);
  PassTouches& touches = p.pass("DXZ1");
  for (std::size_t row = touches.size() / 2; row < touches.size(); ++row) {
    touches[row].reading_m += Vector3(4e-6, -3e-6, 5e-6);
  }
  const auto found = p.identified();
  ASSERT_TRUE(found) << found.error().text;
  EXPECT_NE(found->cause.cause, Cause::None);
  EXPECT_GT(found->solution.residuals[p.number_of("DXZ1")].chi2,
            2.0 * found->solution.residuals[p.number_of("DXZ2")].chi2);
}

TEST(MfbIdentify, SetsOneWrongTouchAside) {
  const std::vector<std::pair<std::string, Target>> wrong{
      {"X2", {Feature::Hole, 4, Side::Left, 3}},
      {"Z1-", {Feature::Rod, 7, Side::Left, 5}},
      {"DXY1", {Feature::Plane, 2, Side::Right, 1}}};
  const auto clean = usual().identified();
  for (const auto& [measurement, target] : wrong) {
    Probed p = usual();
    p.displace(measurement, target, 50e-6);
    const auto found = p.identified();
    ASSERT_TRUE(found) << found.error().text;
    ASSERT_EQ(found->set_aside.size(), 1u) << measurement;
    EXPECT_EQ(found->set_aside[0].measurement_name, measurement);
    EXPECT_EQ(found->set_aside[0].target, target) << name(found->set_aside[0].target);
    EXPECT_NEAR(found->set_aside[0].residual_m, 50e-6, 3e-6);
    EXPECT_LT(agreement(*found, p.machine).translation_um,
              1.05 * agreement(*clean, p.machine).translation_um);
  }
}

TEST(MfbIdentify, KeepsGoodTouchesOfABarWithFormErrors) {
  const Probed p(46, {.form_m = 1e-6});
  const auto found = p.identified();
  ASSERT_TRUE(found) << found.error().text;
  EXPECT_TRUE(found->set_aside.empty());
}

TEST(MfbIdentify, DoesNotNeedASignature) {
  // O_z of 12 holes follows from 11 rods: without the shifts the noise of a combination is 0.
  const Probed p(47, {.signature = false});
  const auto found = p.identified();
  ASSERT_TRUE(found) << found.error().text;
  EXPECT_EQ(found->cause.cause, Cause::None) << found->cause.text;
  EXPECT_NEAR(agreement(*found, p.machine).mean_square, 1.0, 0.4);
  EXPECT_THAT(found->notes, testing::ElementsAre(HasSubstr("no signature")));
}

TEST(MfbIdentify, UsesTheDerivativesOfTheBarAsItIs) {
  const Probed p(48, {.place_m = 0.15e-3});  // some features 0.4 mm beside the pattern
  const auto found = p.identified();
  ASSERT_TRUE(found) << found.error().text;
  EXPECT_EQ(found->cause.cause, Cause::None) << found->cause.text;
  EXPECT_LT(found->solution.statistics.chi2_per_dof, 1.2);
}

TEST(MfbIdentify, UsesFeaturesWithMissingTouches) {
  Probed p = usual();
  std::erase_if(p.pass("Y2"), [](const Touch& t) {
    return (t.target.feature == Feature::Hole && t.target.index == 1 && t.target.k < 2) ||
           (t.target.feature == Feature::Plane && t.target.index == 3 && t.target.k == 0);
  });
  const auto found = p.identified(), clean = usual().identified();
  ASSERT_TRUE(found) << found.error().text;
  EXPECT_NEAR(agreement(*found, p.machine).translation_um,
              agreement(*clean, p.machine).translation_um, 0.02);
}

TEST(MfbIdentify, RefusesAFeatureWithTooFewTouches) {
  Probed p = usual();
  std::erase_if(p.pass("Y2"), [](const Touch& t) {
    return t.target.feature == Feature::Hole && t.target.index == 1 && t.target.k < 3;
  });
  EXPECT_THAT(p.refusal(), StartsWith("Y2: hole 2: 5 of 8 touches"));
  p.pass("Y2").clear();
  EXPECT_THAT(p.refusal(), StartsWith("Y2: hole 1: 0 of 8 touches"));
}

TEST(MfbIdentify, RefusesTouchesThatAreNotOfThePattern) {
  Probed p = usual();
  p.pass("X1").push_back(p.pass("X1").front());
  EXPECT_THAT(p.refusal(), StartsWith("X1: hole 1, k = 0: is given twice"));
  p = usual();
  p.pass("X1").back().target.k = 99;
  EXPECT_THAT(p.refusal(), HasSubstr("has no such touch"));
  p = usual();
  p.touch("X3", {Feature::Rod, 4, Side::Left, 2}).reading_m.y() =
      std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(p.refusal(), StartsWith("X3: rod 5, k = 2: the reading is not a number"));
  p = usual();
  p.probed.touches.pop_back();
  EXPECT_THAT(p.refusal(), HasSubstr("16 passes"));
}

TEST(MfbIdentify, RefusesATurnedBar) {
  // Hole i of the plan is hole 13 - i of a bar turned about z.
  Probed p = usual();
  Plan turned = p.plan;
  Measurement& m = turned.measurements[p.number_of("X2")];
  m.origin_m += 0.55 * m.bar_x;
  m.bar_x = -m.bar_x;
  std::mt19937_64 random(21);
  const SimulatedMachine machine(random);
  p.probed = probe(machine, turned, random);
  for (Touch& t : p.pass("X2")) {
    const bool hole = t.target.feature == Feature::Hole, plane = t.target.feature == Feature::Plane;
    t.target.index = (hole ? 11 : 10) - t.target.index;
    if (plane) {
      t.target.side = t.target.side == Side::Left ? Side::Right : Side::Left;
    }
  }
  EXPECT_THAT(p.refusal(), StartsWith("X2: the bar lies turned about z"));
  EXPECT_THAT(p.refusal(), HasSubstr("mm as planned"));
}

TEST(MfbIdentify, RefusesAPoseBesideThePlan) {
  Probed p = usual();
  p.plan.measurements[p.number_of("Y1")].origin_m += Vector3(0.0, 0.0, 8e-3);
  EXPECT_THAT(p.refusal(), StartsWith("Y1: the bar stands"));
  p = usual();
  std::swap(p.pass("X1"), p.pass("X2"));
  EXPECT_THAT(p.refusal(), HasSubstr("mrad beside the plan"));
}

TEST(MfbIdentify, RefusesAnotherBarOrAWrongTip) {
  Probed p = usual();
  p.plan.tip_radius_m = 2e-3;
  EXPECT_THAT(p.refusal(), StartsWith("X1: hole 1: radius"));
  p = usual();
  for (Touch& t : p.pass("X1")) {  // the holes one pitch further
    if (t.target.feature == Feature::Hole && t.target.index == 5) {
      t.reading_m.x() += 5e-3;
    }
  }
  EXPECT_THAT(p.refusal(), StartsWith("X1: hole 6"));
}

TEST(MfbIdentify, RefusesTheFileOfAnotherBar) {
  Probed p = usual();
  p.probed.bar.pattern.hole_y_m.assign(12, 0.0);  // without signature nothing else would show it
  for (Vector3& O : p.probed.bar.O_m) {
    O.y() = 0.0;
  }
  EXPECT_THAT(p.refusal(), StartsWith("X1: hole 3: its point of interest is"));
}

TEST(MfbIdentify, DegreesOfFreedomOfThePassesAddUp) {
  const auto found = usual().identified();
  ASSERT_TRUE(found) << found.error().text;
  double sum = 0.0, chi2 = 0.0;
  for (const PassResiduals& pass : found->solution.residuals) {
    EXPECT_GT(pass.degrees_of_freedom, 5.0) << pass.measurement;
    sum += pass.degrees_of_freedom;
    chi2 += pass.chi2;
  }
  EXPECT_NEAR(sum, found->solution.statistics.degrees_of_freedom, 1e-6);
  EXPECT_NEAR(chi2, found->solution.statistics.chi2, 1e-9);
}

TEST(MfbIdentify, NamesErrorsThatThePositionsDoNotShow) {
  Probed p = usual();
  const auto drop = [&](const std::string& measurement) {
    const auto m = static_cast<std::ptrdiff_t>(p.number_of(measurement));
    p.plan.measurements.erase(p.plan.measurements.begin() + m);
    p.probed.touches.erase(p.probed.touches.begin() + m);
  };
  drop("X3");
  const auto refused = p.identified();
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::RankDeficient);
  EXPECT_THAT(refused.error().text, HasSubstr("ECX"));
  EXPECT_THAT(refused.error().text, testing::Not(HasSubstr("EAY")));
}

TEST(MfbIdentify, RefusesReadingsFarOutsideTheNodes) {
  const Probed& p = usual();
  MfbMachine machine = paper_machine();
  machine.nodes[1] = *equidistant_nodes(0.0, 0.45);
  const auto refused = identify(p.probed.bar, p.plan, p.probed.touches, machine);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().text, HasSubstr("of Y is more than half a node spacing outside"));
}

TEST(MfbIdentify, SequenceNeedsItsRolesAndItsOrderOfAxes) {
  Probed p = usual();
  Options options;
  options.solve.estimator = Estimator::Sequential;
  const auto found = p.identified(options);
  ASSERT_TRUE(found) << found.error().text;
  // Without noise the sequence would lose the slope of EAX and what the rods see beside the holes.
  EXPECT_LT(agreement(*found, p.machine).translation_um, 1.0);

  p.plan.measurements[p.number_of("Y3-")].tool_offset_m =
      p.plan.measurements[p.number_of("Y3+")].tool_offset_m;
  EXPECT_FALSE(p.identified(options));
  MfbMachine machine = paper_machine();
  machine.chain = *KinematicChain::parse("[w Y' X' b Z t]");
  const auto refused =
      identify(p.probed.bar, usual().plan, usual().probed.touches, machine, options);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().text, HasSubstr("another order"));
}

}  // namespace
