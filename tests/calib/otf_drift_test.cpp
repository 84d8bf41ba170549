#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "abbe/calib/model/model_drift.hpp"
#include "drift_models.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::tests::otf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

TableChange table(const DriftTest& drift, const std::string& name) {
  for (const TableChange& change : drift.tables) {
    if (change.table == name) {
      return change;
    }
  }
  return {};
}

int alarms(RepeatedRuns& runs, const Eigen::VectorXd& change, int count,
           DriftOptions options = {}) {
  int found = 0;
  for (int i = 0; i < count; ++i) {
    found += test_drift(runs.run(change), runs.run(), options)->drifted ? 1 : 0;
  }
  return found;
}

TEST(ModelDrift, FindsNoneInAHundredUnchangedRuns) {
  RepeatedRuns runs(1);
  const VolumetricModel active = runs.run();
  for (int i = 0; i < 100; ++i) {
    EXPECT_FALSE(test_drift(runs.run(), active)->drifted) << i;
  }
}

/// A change by 6 sigma in one combination alone is found with a probability of 0.945, any other one
/// more often: fewer than 17 of 20 have a probability
/// of 0.02 there, and all tables together are found in 19 of 20 cases.
TEST(ModelDrift, FindsATableThatMovedBySixOfItsSigma) {
  RepeatedRuns runs(2);
  int found = 0, moved = 0;
  for (const char* name : {"EXX", "EZZ", "EYX", "EZY", "EAX", "EBY", "EC0Y", "EB0Z"}) {
    const int of_table = alarms(runs, runs.change(name, 6.0), 20);
    EXPECT_GE(of_table, 17) << name;
    found += of_table;
    moved += 20;
  }
  EXPECT_GE(20 * found, 19 * moved);
}

/// Of 400 runs at 10 % at most 64 alarm with a probability of 0.9999; Bonferroni makes it fewer.
TEST(ModelDrift, AlarmsNoMoreOftenThanStated) {
  RepeatedRuns runs(3);
  const int found = alarms(runs, runs.no_change(), 400, {.false_alarm = 0.1});
  EXPECT_LE(found, 64);
  EXPECT_GE(found, 8);
}

TEST(ModelDrift, NamesTheTableThatMovedAndNoOther) {
  RepeatedRuns runs(4);
  for (const char* name : {"EXX", "EYX", "EAX", "EC0Y"}) {
    const DriftTest drift = *test_drift(runs.run(runs.change(name, 20.0)), runs.run());
    EXPECT_THAT(drift.drifted_tables(), ElementsAre(name));
    EXPECT_GT(drift.rest.p, drift.rest.limit) << name;
  }
}

TEST(ModelDrift, NamesTwoTablesThatMovedTogether) {
  RepeatedRuns runs(5);
  const DriftTest drift =
      *test_drift(runs.run(runs.change("EYY", 30.0) + runs.change("ECX", 30.0)), runs.run());
  EXPECT_THAT(drift.drifted_tables(), ElementsAre("ECX", "EYY"));
}

TEST(ModelDrift, StatesTheChangeWithItsUncertainty) {
  RepeatedRuns runs(6);
  const Eigen::VectorXd change = runs.change("EXX", 20.0);
  double squares = 0.0;
  constexpr int kRuns = 100;
  for (int i = 0; i < kRuns; ++i) {
    const TableChange found = table(*test_drift(runs.run(change), runs.run()), "EXX");
    const auto node = runs.layout().nodes()[0].nodes_m;
    const bool at_end = *found.position_m == node.back();
    const double truth = at_end ? change(static_cast<Eigen::Index>(node.size()) - 1) : change(0);
    squares += std::pow((found.change - truth) / found.u, 2) / kRuns;
  }
  EXPECT_NEAR(squares, 1.0, 0.45);  // three standard deviations of chi-square of 100, sqrt(2/100)
}

TEST(ModelDrift, StatesOneChangeInPlainNumbers) {
  const TableChange change{.table = "EAX",
                           .test = {40.0, 1, 2.5e-10, 1e-6},
                           .change = 12e-6,
                           .u = 2e-6,
                           .position_m = 0.3,
                           .is_angle = true};
  EXPECT_EQ(text(change),
            "EAX changed by 12 urad at 300 mm (standard uncertainty 2 urad): chi-square 40 with 1 "
            "degree of freedom, p 2.5e-10");
}

TEST(ModelDrift, StatesTheMostSignificantChangesOfMany) {
  DriftTest drift{.drifted = true};
  for (const double chi2 : {50.0, 70.0, 90.0, 40.0}) {
    drift.tables.push_back({.table = "EXX",
                            .drifted = true,
                            .test = {.statistic = chi2},
                            .change = 1e-7 * chi2,
                            .u = 1.23456e-6});
  }
  EXPECT_EQ(text(drift),
            "EXX by 9 um (u 1.23 um), EXX by 7 um (u 1.23 um), EXX by 5 um (u 1.23 um) and 1 more");
}

TEST(ModelDrift, AnUnchangedMachineHasNoText) {
  RepeatedRuns runs(7);
  EXPECT_THAT(text(*test_drift(runs.run(), runs.run())), IsEmpty());
}

/// As if the machine had warmed up: every parameter changed.
TEST(ModelDrift, FindsThatEverythingMoved) {
  RepeatedRuns runs(8);
  Eigen::VectorXd all = runs.no_change();
  for (const char* name : {"EXX", "EYY", "EZZ", "EYX", "EZX", "EAX", "EC0Y", "EB0Z", "EA0Z"}) {
    all += runs.change(name, 15.0);
  }
  const DriftTest drift = *test_drift(runs.run(all), runs.run());
  EXPECT_GE(drift.drifted_tables().size(), 6u);
  EXPECT_GT(drift.rest.p, drift.rest.limit);
}

/// One wrong node, as from an outlier.
TEST(ModelDrift, FindsASingleNode) {
  RepeatedRuns runs(9);
  Eigen::VectorXd change = runs.no_change();
  change(1) = 12.0 * std::sqrt(2.0 * runs.model().covariance()(1, 1));
  const DriftTest drift = *test_drift(runs.run(change), runs.run());
  EXPECT_THAT(drift.drifted_tables(), ElementsAre(runs.model().parameters()[1].name));
}

TEST(ModelDrift, AModelWithoutUncertaintyLeavesThatOfTheOther) {
  RepeatedRuns runs(10);
  const VolumetricModel exact = runs.with(runs.model().U(), 1e-30 * runs.model().covariance());
  for (int i = 0; i < 20; ++i) {
    EXPECT_FALSE(test_drift(runs.run(), exact)->drifted) << i;
  }
}

TEST(ModelDrift, RefusesTwoModelsWithoutUncertainty) {
  RepeatedRuns runs(11);
  const VolumetricModel exact = runs.with(runs.model().U(), 0.0 * runs.model().covariance());
  EXPECT_EQ(test_drift(exact, exact).error().code, ErrorCode::NotApplicable);
}

TEST(ModelDrift, RefusesAnotherToolOffset) {
  RepeatedRuns runs(12);
  ModelDescription other = runs.model().description();
  other.tool_offsets_m.front().z() += 1e-3;
  const auto drift = test_drift(*VolumetricModel::from_description(other), runs.model());
  ASSERT_FALSE(drift);
  EXPECT_EQ(drift.error().code, ErrorCode::NotApplicable);
  EXPECT_THAT(drift.error().text, HasSubstr("tool"));
}

TEST(ModelDrift, RefusesOtherNodes) {
  RepeatedRuns runs(13);
  ModelDescription other = runs.model().description();
  const double moved_m = other.nodes[0].nodes_m[1] += 1e-3;
  for (Parameter& p : other.parameters) {
    const bool of_x = p.position_m && p.name.back() == 'X';
    p.position_m = of_x && std::abs(*p.position_m - moved_m) < 2e-3 ? moved_m : p.position_m;
  }
  const auto drift = test_drift(*VolumetricModel::from_description(other), runs.model());
  ASSERT_FALSE(drift);
  EXPECT_THAT(drift.error().text, HasSubstr("axis X has other nodes"));
}

TEST(ModelDrift, RefusesAFalseAlarmThatIsNoProbability) {
  RepeatedRuns runs(14);
  for (const double wrong : {0.0, 1.0, -1.0, std::nan("")}) {
    EXPECT_EQ(test_drift(runs.run(), runs.run(), {.false_alarm = wrong}).error().code,
              ErrorCode::BadInput);
  }
}

Verdict verdict_of_unchanged_machine() {
  Verdict v;
  v.held_out = {.no_compensation = 50.0, .candidate = 1.1, .observations = 1000, .active = 1.0};
  v.refuse("held-out", "the active model remains valid");
  return v;
}

TEST(ModelDrift, ARunThatIsOnlyNotBetterThanTheActiveModelShowsTheMachine) {
  Verdict v = verdict_of_unchanged_machine();
  EXPECT_TRUE(shows_machine(v));
  v.refuse("moved", "the tracker moved");
  EXPECT_FALSE(shows_machine(v));
}

TEST(ModelDrift, ARunThatIsNotBetterThanNoCompensationDoesNotShowTheMachine) {
  Verdict v = verdict_of_unchanged_machine();
  v.held_out.candidate = 60.0;
  EXPECT_FALSE(shows_machine(v));
}

}  // namespace
