// The verdict on a joint model, and what its parts contribute.
#include "abbe/calib/joint/judge.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "abbe/calib/joint/contribution.hpp"
#include "abbe/calib/model/model_comparison.hpp"
#include "joint_parts.hpp"

namespace {
namespace joint = abbe::calib::joint;
namespace otf = abbe::calib::otf;
using abbe::calib::Vector3;
using abbe::calib::Verdict;
using abbe::tests::otf::MadeRun;
using abbe::tests::otf::make_run;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

/// A run and an array of one machine.
struct JudgedParts {
  MadeRun run;
  otf::Identification found;
  joint::CommonTables common;
  std::vector<joint::Part> parts;

  explicit JudgedParts(abbe::calib::Interpolation kind = abbe::calib::Interpolation::Linear)
      : run(make_run({.seed = 1, .interpolation = kind})),
        found(*otf::identify(run.samples, run.machine, run.path, run.noise, run.options)),
        common(*joint::tables_of(found.solution.model)) {
    const abbe::calib::VolumetricModel& model = found.solution.model;
    parts.push_back(*joint::part_of_run("run", model, common));
    const auto array = abbe::tests::joint::observed_array(
        run,
        [&](const Vector3& q, const Vector3& tool) {
          return common.basis.V_m({.q_m = q, .tool_offset_m = tool},
                                  {run.truth.data(), common.basis.size()});
        },
        {.tool_m = run.machine.target_offset_m});
    parts.push_back(*joint::part_of_array("array", array, common));
  }
  [[nodiscard]] std::vector<joint::RunOfPart> runs() const {
    return {{0, &found.observations, {}}};
  }
};

TEST(JointVerdict, AcceptsAModelThatPredictsLegsThatWereHeldOut) {
  const JudgedParts m;
  const auto model = joint::joint_model(m.parts, m.common);
  ASSERT_TRUE(model) << model.error().text;
  const auto verdict =
      joint::judge(*model, m.parts, m.runs(), m.common, nullptr, {}, m.run.options);
  ASSERT_TRUE(verdict) << verdict.error().text;
  EXPECT_THAT(verdict->reasons, IsEmpty());
  EXPECT_NEAR(verdict->held_out.candidate, 1.0, 0.1);
  EXPECT_GT(verdict->held_out.no_compensation, 2.0);
  EXPECT_GT(verdict->held_out.observations, m.found.observations.rows.size() / 2);

  // The joint model was fitted to these legs, so that it must not be worse than its folds.
  const auto beside = joint::held_out(m.parts, m.runs(), m.common, &model->model, m.run.options);
  ASSERT_TRUE(beside && beside->active);
  EXPECT_LE(*beside->active, *beside->candidate_beside_active);
}

TEST(JointVerdict, KeepsTheInterpolationOfTheTables) {
  const JudgedParts m(abbe::calib::Interpolation::NaturalCubic);
  const auto model = joint::joint_model(m.parts, m.common);
  ASSERT_TRUE(model) << model.error().text;
  EXPECT_EQ(model->model.interpolation(), abbe::calib::Interpolation::NaturalCubic);
  const auto verdict =
      joint::judge(*model, m.parts, m.runs(), m.common, nullptr, {}, m.run.options);
  ASSERT_TRUE(verdict) << verdict.error().text;
  EXPECT_NEAR(verdict->held_out.candidate, 1.0, 0.1);
}

TEST(JointVerdict, TakesFaultsOfTheDataOfAPartAndNotesTheRest) {
  Verdict of_part;
  of_part.refuse("drift", "the machine drifts");
  of_part.refuse("uncertainty", "more than half of it");
  of_part.notes = {"a note"};
  Verdict verdict{.accepted = true};
  joint::add_verdict_of_part(verdict, "run 2", of_part);
  EXPECT_FALSE(verdict.accepted);
  EXPECT_THAT(verdict.reasons, ElementsAre("run 2: the machine drifts"));
  EXPECT_THAT(verdict.causes, ElementsAre("drift"));
  EXPECT_THAT(verdict.notes,
              ElementsAre(HasSubstr("run 2: more than half of it"), "run 2: a note"));
}

TEST(JointContributions, AreUncertaintiesAloneAndWithoutThePart) {
  const JudgedParts m;
  const auto shares = joint::contributions(m.parts, m.common);
  ASSERT_TRUE(shares) << shares.error().text;
  const double u_m = otf::correction_size(joint::joint_model(m.parts, m.common)->model).u_m;
  const double of_run_m = otf::correction_size(m.found.solution.model).u_m;
  ASSERT_TRUE((*shares)[0].u_alone_m);
  EXPECT_NEAR(*(*shares)[0].u_alone_m, of_run_m, 1e-6 * of_run_m);
  EXPECT_LT(u_m, of_run_m);
  for (const joint::Contribution& share : *shares) {
    EXPECT_TRUE(!share.u_alone_m || *share.u_alone_m > u_m);
    EXPECT_TRUE(!share.u_without_m || *share.u_without_m > u_m);
  }
  EXPECT_EQ((*shares)[0].u_alone_m, (*shares)[1].u_without_m);

  const auto tables = joint::table_uncertainties(m.found.solution.model);
  EXPECT_EQ(tables.size(), 17u);
  EXPECT_EQ(tables.front().table, "EXX");
}

}  // namespace
