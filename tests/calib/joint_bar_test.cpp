// The part of a Multi-Feature Bar in a joint identification (joint/part.hpp).

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "abbe/calib/joint/contribution.hpp"
#include "abbe/calib/mfb/solve/solve.hpp"
#include "abbe/calib/model/model_comparison.hpp"
#include "abbe/calib/otf/judge/lack_of_fit.hpp"
#include "joint_triple.hpp"

namespace {
namespace joint = abbe::calib::joint;
using abbe::calib::Vector3;
using abbe::tests::joint::Triple;
using abbe::tests::joint::triple_bar;
using abbe::tests::joint::triple_machine;
using abbe::tests::joint::TripleMachine;
using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;
using testing::StartsWith;

joint::CommonTables common_of(const TripleMachine& m) {
  return {*abbe::calib::TableBasis::of(abbe::tests::otf::layout_of(m.run.machine)),
          m.run.machine.target_offset_m};
}

/// The bar was touched with several tools and shows all 18 tables; the part has the 14 of another
/// tool. Both predict the same V for this tool.
TEST(JointBar, PredictsTheSameAsTheAdjustmentOfTheBarItself) {
  const TripleMachine m = triple_machine(1);
  const joint::CommonTables common = common_of(m);
  const auto observed = triple_bar(m, common, abbe::tests::mfb::paper_plan());
  const auto own = abbe::calib::mfb::solve(observed);
  ASSERT_TRUE(own) << own.error().text;
  const auto part = joint::part_of_bar("bar", observed, common);
  ASSERT_TRUE(part) << part.error().text;
  const auto model = joint::joint_model(std::array{*part}, common);
  ASSERT_TRUE(model) << model.error().text;

  const auto places_m = abbe::calib::tensor_grid(m.run.machine.nodes);
  const Vector3& t = common.tool_offset_m;
  std::vector<Vector3> difference_m;
  for (const Vector3& q : places_m) {
    difference_m.push_back(
        model->model.V_at(q, t) -
        observed.basis.V_m({.q_m = q, .tool_offset_m = t}, {own->U.data(), observed.basis.size()}));
  }
  const auto left = abbe::calib::rigid_free(places_m, difference_m);
  ASSERT_TRUE(left);
  EXPECT_LT(left->rigid_free.rms_m, 1e-10);  // errors are 40 um, u is 0.3 um
}

TEST(JointBar, GivesOneModelWithARunAndAnArray) {
  const TripleMachine m = triple_machine(1);
  const Triple t = abbe::tests::joint::triple(m, abbe::tests::mfb::paper_plan());
  const auto result = joint::identify(t.parts, t.common);
  ASSERT_TRUE(result) << result.error().text;
  ASSERT_THAT(result->contradictions, IsEmpty());
  EXPECT_THAT(result->pairs, SizeIs(3));
  EXPECT_THAT(result->directed, SizeIs(3 * 7));

  const double u_m = abbe::calib::otf::correction_size(result->joint->model).u_m;
  const auto contributions = joint::contributions(t.parts, t.common);
  ASSERT_TRUE(contributions);
  for (const joint::Contribution& of : *contributions) {
    EXPECT_GE(of.u_without_m.value_or(1.0), u_m);
    EXPECT_GT(of.u_alone_m.value_or(1.0), u_m);
  }

  const auto places_m = abbe::calib::tensor_grid(m.run.machine.nodes);
  const Vector3& tool_m = t.common.tool_offset_m;
  std::vector<Vector3> errors_m;
  for (const Vector3& q : places_m) {
    errors_m.push_back(result->joint->model.V_at(q, tool_m) - m.field()(q, tool_m));
  }
  EXPECT_LT(abbe::calib::rigid_free(places_m, errors_m)->rigid_free.rms_m, 4.0 * u_m);
}

TEST(JointBar, ShowsWhichOfThreePartsHasTheWrongLength) {
  const TripleMachine m = triple_machine(2);
  const Triple t = abbe::tests::joint::triple(m, abbe::tests::mfb::paper_plan(), 20e-6);
  const auto result = joint::identify(t.parts, t.common);
  ASSERT_TRUE(result) << result.error().text;
  ASSERT_THAT(result->contradictions, testing::Not(IsEmpty()));
  EXPECT_THAT(result->contradictions,
              testing::Contains(AllOf(StartsWith("array: its lengths are smaller by "),
                                      HasSubstr("than those of all other parts"))));
}

/// The calibration of a bar is one error in all measurements with it.
TEST(JointBar, HasTheErrorsOfItsCalibrationAsEffects) {
  const TripleMachine m = triple_machine(1);
  const joint::CommonTables common = common_of(m);
  const auto observed = triple_bar(m, common, abbe::tests::mfb::paper_plan());
  const auto part = joint::part_of_bar("bar 2", observed, common, {.bar = "bar.toml"});
  ASSERT_TRUE(part);
  // 3 N coordinates without O_1 and y, z of O_N
  ASSERT_THAT(part->effects, SizeIs(3 * observed.bar.O_m.size() - 5));
  EXPECT_EQ(part->effects.front(), "calibration 1 of bar.toml");
  EXPECT_NEAR(part->u_of_effects.front(), 0.2e-6, 1e-12);
}

/// So are the errors of its expansion and of the thermometer.
TEST(JointBar, HasTheErrorsOfExpansionAndThermometerAsEffects) {
  const TripleMachine m = triple_machine(1);
  const joint::CommonTables common = common_of(m);
  auto observed = triple_bar(m, common, abbe::tests::mfb::paper_plan());
  observed.bar.expansion = abbe::calib::Expansivity{11e-6, 0.5e-6};
  observed.plan.noise.u_common_temperature_K = 0.2;
  for (auto& pass : observed.passes) {
    pass.temperature_K = abbe::calib::kReferenceTemperature_K + 1.0;
  }
  const auto part = joint::part_of_bar("bar", observed, common, {.bar = "bar.toml"});
  ASSERT_TRUE(part) << part.error().text;
  const std::size_t effects = part->effects.size();
  ASSERT_EQ(part->information.unknowns(), common.basis.size() + effects);
  EXPECT_EQ(part->effects[effects - 2], "expansion of bar.toml");
  EXPECT_EQ(part->effects[effects - 1], "thermometer of bar.toml");
  EXPECT_NEAR(part->u_of_effects[effects - 1], 11e-6 * 0.2, 1e-15);
  // One K for each u of the expansion, u of the temperature for that of the thermometer: both
  // lengthen the bar.
  const auto squared = [&](std::size_t effect) {
    return part->information.squared_length(common.basis.size() + effect);
  };
  const double ratio = 11e-6 * 0.2 / (0.5e-6 * 1.0);
  EXPECT_NEAR(squared(effects - 1), ratio * ratio * squared(effects - 2),
              1e-6 * squared(effects - 1));
}

TEST(JointBar, RefusesObservationsOnOtherNodes) {
  const TripleMachine m = triple_machine(1);
  joint::CommonTables common = common_of(m);
  const auto observed = triple_bar(m, common, abbe::tests::mfb::paper_plan());
  common.basis = *abbe::calib::TableBasis::of(
      abbe::tests::otf::layout_of(abbe::tests::otf::coarse_machine("[w X' b Y Z (C1) t]")));
  const auto part = joint::part_of_bar("bar", observed, common);
  ASSERT_FALSE(part);
  EXPECT_EQ(part.error().code, abbe::calib::ErrorCode::NotApplicable);
  EXPECT_THAT(part.error().text, HasSubstr("joint identification: bar: the bar was observed on"));
}

}  // namespace
