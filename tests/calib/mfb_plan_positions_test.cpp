/// Positions of a Multi-Feature Bar for a machine's travel, and what they show.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "mfb_planning.hpp"

namespace abbe::calib::mfb {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::IsSupersetOf;
using ::testing::SizeIs;
using tests::mfb::paper_task;
using tests::mfb::task_for;

PlannedSet set_of(NamedSet which, const PlanTask& task) {
  const Result<PlannedSet> set = named_set(which, task);
  EXPECT_TRUE(set) << (set ? "" : set.error().text);
  return set.value_or(PlannedSet{});
}

PlanPrediction prediction_of(const PlanTask& task, const std::vector<PlannedPosition>& positions) {
  const Result<PlanPrediction> p = predict(task.bar, plan_of(task, positions), task.machine);
  EXPECT_TRUE(p) << (p ? "" : p.error().text);
  return p.value_or(PlanPrediction{});
}

double rms_u_of(const PlanPrediction& p, std::string_view error) {
  for (const ErrorUncertainty& e : p.errors) {
    if (e.name == error) {
      return e.rms_u;
    }
  }
  ADD_FAILURE() << "no error " << error;
  return 0.0;
}

/// All touches are at most the radius of a hole outside the nodes.
void expect_within_travel(const PlanTask& task, const std::vector<PlannedPosition>& positions) {
  constexpr double kRounding_m = 0.06e-3;  // places of O_1 are multiples of 0.1 mm
  const double outside_m = task.bar.pattern.hole_radius_m + kRounding_m;
  for (const PlannedPosition& position : positions) {
    const ReadingRange range = readings_of(task.bar, plan_of(task, {position}));
    for (std::size_t k = 0; k < 3; ++k) {
      const std::vector<double>& nodes_m = task.machine.nodes[k].nodes_m;
      EXPECT_GE(range.min_m(static_cast<Eigen::Index>(k)), nodes_m.front() - outside_m)
          << position.name;
      EXPECT_LE(range.max_m(static_cast<Eigen::Index>(k)), nodes_m.back() + outside_m)
          << position.name;
    }
  }
}

std::vector<PlannedPosition> without(std::vector<PlannedPosition> positions, char first_letter,
                                     char last_letter) {
  std::erase_if(positions, [&](const PlannedPosition& p) {
    return p.name.front() == first_letter && (last_letter == 0 || p.name.back() == last_letter);
  });
  return positions;
}

TEST(MfbPlanPositions, ThePaperSetIsThatOfTheReferenceData) {
  const tests::mfb::json all = tests::mfb::reference("identification_reference.json");
  const Plan expected = tests::mfb::plan_of(all.at("cases").at(0));
  const PlanTask task = paper_task();
  const Plan plan = plan_of(task, set_of(NamedSet::Paper, task).positions);
  ASSERT_EQ(plan.measurements.size(), expected.measurements.size());

  constexpr double kRounding_m = 0.051e-3;  // places of O_1 are multiples of 0.1 mm
  for (const Measurement& e : expected.measurements) {
    const auto m = std::find_if(plan.measurements.begin(), plan.measurements.end(),
                                [&](const Measurement& one) { return one.name == e.name; });
    ASSERT_NE(m, plan.measurements.end()) << e.name;
    EXPECT_LE((m->origin_m - e.origin_m).cwiseAbs().maxCoeff(), kRounding_m) << e.name;
    EXPECT_LE((m->axes() - e.axes()).cwiseAbs().maxCoeff(), 1e-12) << e.name;
    EXPECT_LE((m->tool_offset_m - e.tool_offset_m).norm(), 1e-12) << e.name;
  }
}

TEST(MfbPlanPositions, X3RolledShowsEzxAndEb0zBetter) {
  const PlanTask task = paper_task();
  const PlanPrediction paper = prediction_of(task, set_of(NamedSet::Paper, task).positions);
  const PlanPrediction rolled = prediction_of(task, set_of(NamedSet::Rolled, task).positions);
  EXPECT_LE(rms_u_of(rolled, "EZX"), 0.26e-6);
  EXPECT_LE(rms_u_of(rolled, "EB0Z"), 1.4e-6);
  EXPECT_GT(rms_u_of(paper, "EZX"), 1.5 * rms_u_of(rolled, "EZX"));
  EXPECT_LT(rolled.worst, paper.worst);
}

TEST(MfbPlanPositions, TwelveMeasurementsShowAllErrors) {
  const PlanTask task = paper_task();
  const PlannedSet minimum = set_of(NamedSet::Minimum, task);
  EXPECT_EQ(minimum.measurements(), 12u);
  EXPECT_THAT(prediction_of(task, minimum.positions).not_seen, IsEmpty());
}

TEST(MfbPlanPositions, ErrorsThatASetCannotShowAreNamed) {
  const PlanTask task = paper_task();
  const std::vector<PlannedPosition> all = set_of(NamedSet::Paper, task).positions;
  EXPECT_THAT(prediction_of(task, without(all, 'D', 0)).not_seen,
              IsSupersetOf({"EA0Z", "EB0Z", "EC0Y"}));
  EXPECT_THAT(prediction_of(task, without(all, 'X', '3')).not_seen, Contains("ECX"));

  std::vector<PlannedPosition> one_stylus = all;
  for (PlannedPosition& p : one_stylus) {
    p.styli.resize(1);
  }
  EXPECT_THAT(prediction_of(task, one_stylus).not_seen, IsSupersetOf({"EAZ", "EBZ", "ECZ"}));
}

TEST(MfbPlanPositions, BarsOverlapAlongALongerAxis) {
  const PlanTask task = task_for(6, {0.6, 0.25, 0.25}, 0.05);
  const PlannedSet set = set_of(NamedSet::Rolled, task);
  std::vector<double> starts_m;
  for (const PlannedPosition& p : set.positions) {
    if (p.name.starts_with("X1")) {
      starts_m.push_back(p.pose.origin_m.x());
    }
  }
  // 0.6 m of travel, 0.25 m of bar, half of it in common: steps of at most 0.125 m.
  EXPECT_THAT(starts_m, SizeIs(4));
  EXPECT_NEAR(starts_m.front(), 0.0, 1e-9);
  EXPECT_NEAR(starts_m.back(), 0.35, 1e-9);
  EXPECT_THAT(set.notes, Contains(HasSubstr("X1: 4 bars overlap along X")));
  EXPECT_THAT(prediction_of(task, set.positions).not_seen, IsEmpty());
  expect_within_travel(task, set.positions);
}

TEST(MfbPlanPositions, TheBarIsInclinedAlongAShorterAxis) {
  const PlanTask task = task_for(12, {0.55, 0.55, 0.4});
  for (const NamedSet which : kNamedSets) {
    const PlannedSet set = set_of(which, task);
    EXPECT_THAT(set.notes, Contains(HasSubstr("Z1: Z is shorter than the bar")));
    EXPECT_THAT(prediction_of(task, set.positions).not_seen, IsEmpty()) << name(which);
    expect_within_travel(task, set.positions);
  }
}

TEST(MfbPlanPositions, ABarThatFitsNowhereIsRefusedWithTheTravelThatItNeeds) {
  const auto short_travel = named_set(NamedSet::Rolled, task_for(12, Vector3::Constant(0.3)));
  ASSERT_FALSE(short_travel);
  EXPECT_EQ(short_travel.error().code, ErrorCode::NotApplicable);
  EXPECT_THAT(short_travel.error().text, HasSubstr("about 461 mm of X are needed"));

  const auto long_arms = named_set(NamedSet::Rolled, task_for(12, Vector3::Constant(0.55), 0.3));
  ASSERT_FALSE(long_arms);
  EXPECT_THAT(long_arms.error().text, HasSubstr("use styli with shorter arms"));
}

TEST(MfbPlanPositions, MeasurementsWithoutAStylusAreNamed) {
  PlanTask task = paper_task();
  std::erase_if(task.styli, [](const Stylus& s) { return s.stem.x() > 0.5; });
  EXPECT_THAT(set_of(NamedSet::Paper, task).missing,
              ElementsAre(HasSubstr("Y3 from the second side: no stylus has its stem along +X"),
                          HasSubstr("Z1 from the second side")));
  std::erase_if(task.styli, [](const Stylus& s) { return s.stem.x() < -0.5; });
  EXPECT_THAT(set_of(NamedSet::Paper, task).missing,
              Contains("DYZ1: no stylus has its stem along X"));
}

TEST(MfbPlanPositions, RolesFollowTheOrderOfTheAxes) {
  PlanTask task = paper_task();
  task.machine.chain = *KinematicChain::parse("[w Y' X' b Z t]");
  const PlannedSet set = set_of(NamedSet::Rolled, task);
  EXPECT_EQ(set.positions.front().name, "Y1");
  EXPECT_NEAR(set.positions.front().pose.axes(1, 0), 1.0, 1e-12);
  EXPECT_EQ(set.measurements(), 17u);
  EXPECT_THAT(prediction_of(task, set.positions).not_seen, IsEmpty());
}

TEST(MfbPlanPositions, CandidatesAreWithinTheTravelAndOfBothKinds) {
  const PlanTask task = paper_task();
  const auto candidates = candidate_positions(task);
  ASSERT_TRUE(candidates) << candidates.error().text;
  EXPECT_GT(candidates->size(), 100u);
  expect_within_travel(task, *candidates);

  const auto both_sides = std::count_if(candidates->begin(), candidates->end(),
                                        [](auto& c) { return c.styli.size() == 2; });
  EXPECT_GT(both_sides, 30);
  for (const PlannedPosition& c : *candidates) {
    const Matrix3& axes = c.pose.axes;
    EXPECT_LE((axes.transpose() * axes - Matrix3::Identity()).norm(), 1e-12);
    EXPECT_NEAR(task.styli[c.styli.front()].stem.dot(axes.col(2)), -1.0, 1e-12);
  }
}

TEST(MfbPlanPositions, EveryPassHasABackwardPair) {
  PlanTask task = paper_task();
  task.backward = true;
  const Plan plan = plan_of(task, set_of(NamedSet::Minimum, task).positions);
  ASSERT_EQ(plan.measurements.size(), 24u);
  EXPECT_TRUE(check(plan, task.bar)) << check(plan, task.bar).error().text;
  const auto pairs = pairs_of(plan.measurements);
  for (std::size_t i = 0; i < pairs.size(); i += 2) {
    EXPECT_EQ(pairs[i], std::nullopt);
    EXPECT_EQ(pairs[i + 1], i);
  }
}

TEST(MfbPlanPositions, TheStemIsAcrossTheRamIfTheTipIsBesideIt) {
  const KinematicChain chain;
  EXPECT_EQ(stylus_of({0, 0, -0.15}, chain).stem, Vector3(-Vector3::UnitZ()));
  EXPECT_EQ(stylus_of({0.001, 0, -0.15}, chain).stem, Vector3(-Vector3::UnitZ()));
  EXPECT_EQ(stylus_of({0.1, 0, -0.15}, chain).stem, Vector3(Vector3::UnitX()));
  EXPECT_EQ(stylus_of({0, -0.1, -0.15}, chain).stem, Vector3(-Vector3::UnitY()));
  EXPECT_EQ(stylus_of({0, -0.15, 0}, *KinematicChain::parse("[w b X Z Y t]")).stem,
            Vector3(-Vector3::UnitY()));
}

struct BadTask {
  const char* what;
  void (*spoil)(PlanTask&);
};
class MfbPlanInput : public ::testing::TestWithParam<BadTask> {};

TEST_P(MfbPlanInput, IsRefused) {
  PlanTask task = paper_task();
  GetParam().spoil(task);
  const auto set = named_set(NamedSet::Rolled, task);
  ASSERT_FALSE(set);
  EXPECT_THAT(set.error().text, HasSubstr(GetParam().what));
}

INSTANTIATE_TEST_SUITE_P(
    Faults, MfbPlanInput,
    ::testing::Values(
        BadTask{"no stylus", [](PlanTask& task) { task.styli.clear(); }},
        BadTask{"two styli", [](PlanTask& task) { task.styli.push_back(task.styli.front()); }},
        BadTask{"no direction", [](PlanTask& task) { task.styli.front().stem.setZero(); }},
        BadTask{"not finite",
                [](PlanTask& task) { task.styli.front().tool_offset_m.x() = std::nan(""); }},
        BadTask{"does not fit into holes",
                [](PlanTask& task) { task.settings.tip_radius_m = 9e-3; }},
        BadTask{"noise", [](PlanTask& task) { task.settings.noise = {}; }},
        BadTask{"overlap", [](PlanTask& task) { task.overlap = 1.0; }},
        BadTask{"axis Y has no travel",
                [](PlanTask& task) { task.machine.nodes[1].nodes_m = {0.0}; }}));

}  // namespace
}  // namespace abbe::calib::mfb
