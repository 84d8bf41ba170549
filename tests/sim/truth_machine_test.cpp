#include "abbe/sim/truth_machine.hpp"

#include <gmock/gmock.h>

#include <Eigen/Geometry>

#include "abbe/sim/random_truth.hpp"
#include "abbe/sim/truth_table.hpp"
#include "reference_case.hpp"

namespace abbe::sim {
namespace {

constexpr double kRounding_m = 1e-13;  // 13 digits of the reference file, lengths below 1 m

TruthMachine small_machine() {
  TruthMachine machine;
  machine.axis(Axis::X).range = {-0.3, 0.3, 0.0};
  machine.axis(Axis::Y).range = {-0.25, 0.25, 0.0};
  machine.axis(Axis::Z).range = {-0.4, 0.0, 0.0};
  machine.target_offset_m = {0.02, -0.015, -0.12};
  return machine;
}

TEST(TruthMachine, AgreesWithTheExactTransformsOfTheReferenceCase) {
  const TruthMachine machine = test::reference_machine(Shape::Linear);
  const auto rows =
      test::read_rows(std::string(ABBE_TEST_DATA) + "/otf/caseA_V_true_at_points.csv");
  ASSERT_EQ(rows.size(), 50u);
  for (const auto& row : rows) {
    const Eigen::Vector3d q(std::stod(row[0]), std::stod(row[1]), std::stod(row[2]));
    const Eigen::Vector3d exact(std::stod(row[6]), std::stod(row[7]), std::stod(row[8]));
    EXPECT_LT((error_m(machine, q) - exact).cwiseAbs().maxCoeff(), kRounding_m);
  }
}

TEST(TruthMachine, WithoutErrorsReachesTheCommandedPosition) {
  const TruthMachine machine = small_machine();
  const Eigen::Vector3d q(0.1, -0.2, -0.3);
  EXPECT_EQ(position_m(machine, q), q + machine.target_offset_m);
}

TEST(TruthMachine, AnAxisRotatesTheAxesBetweenItAndTheTool) {
  TruthMachine machine = small_machine();
  const double angle = 1e-3;
  machine.axis(Axis::X).error[5] = ErrorFunction({-1.0, 1.0}, {angle, angle});  // ECX
  const Eigen::Vector3d q(0.1, 0.2, -0.3);
  const Eigen::Vector3d lever = machine.target_offset_m + Eigen::Vector3d(0.0, 0.2, -0.3);
  const Eigen::Vector3d turned = Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ()) * lever;
  EXPECT_LT((error_m(machine, q) - (turned - lever)).norm(), 1e-15);
}

TEST(TruthMachine, LeverDependsOnTheOrderOfTheAxes) {
  TruthMachine machine = small_machine();
  machine.order = parse_chain("[w Z' X' b Y (C1) t]").value();
  machine.axis(Axis::X).error[5] = ErrorFunction({-1.0, 1.0}, {1e-3, 1e-3});
  machine.target_offset_m.setZero();
  // Z is now nearer to the workpiece than X: the lever is y alone.
  const Eigen::Vector3d v = error_m(machine, {0.1, 0.2, -0.3});
  EXPECT_NEAR(v.x(), -1e-3 * 0.2, 1e-9);
  EXPECT_NEAR(v.z(), 0.0, 1e-15);
}

TEST(TruthMachine, SquarenessTiltsTheTravelButNotTheTool) {
  TruthMachine machine = small_machine();
  machine.squareness.C0Y_rad = 1e-3;
  const Eigen::Vector3d v = error_m(machine, {0.0, 0.2, 0.0});
  EXPECT_NEAR(v.x(), -1e-3 * 0.2, 1e-9);
  EXPECT_NEAR(v.y(), -0.5e-6 * 0.2, 1e-12);  // the direction is normalised
  EXPECT_EQ(error_m(machine, Eigen::Vector3d::Zero()), Eigen::Vector3d::Zero());
}

TEST(TruthMachine, BacklashIsTheDifferenceBetweenTheDirections) {
  TruthMachine machine = small_machine();
  machine.axis(Axis::Y).backlash[1] = 4e-6;
  const Eigen::Vector3d up = error_m(machine, Eigen::Vector3d::Zero(), {{0, 1, 0}, 0.0});
  const Eigen::Vector3d down = error_m(machine, Eigen::Vector3d::Zero(), {{0, -1, 0}, 0.0});
  EXPECT_LT((up - down - Eigen::Vector3d(0, 4e-6, 0)).norm(), 1e-16);
}

TEST(TruthMachine, ExpandsAsItWarmsUp) {
  TruthMachine machine = small_machine();
  machine.thermal.expansion_per_m.x() = 20e-6;
  machine.thermal.time_constant_s = 100.0;
  EXPECT_EQ(machine.thermal.heat_after(-1.0), 0.0);
  const double heat = machine.thermal.heat_after(100.0);
  EXPECT_NEAR(error_m(machine, {0.2, 0, 0}, {{}, heat}).x(), 4e-6 * (1.0 - std::exp(-1.0)), 1e-15);
}

TEST(Chain, IsReadFromWorkpieceToTool) {
  EXPECT_THAT(parse_chain("[w X' b Y Z (C1) t]").value(),
              testing::ElementsAre(Axis::X, Axis::Y, Axis::Z));
  EXPECT_THAT(parse_chain("[w b Z X Y t]").value(),
              testing::ElementsAre(Axis::Z, Axis::X, Axis::Y));
}

TEST(Chain, WithoutEveryLinearAxisIsRefused) {
  EXPECT_FALSE(parse_chain("[w X' b Y t]"));
  EXPECT_FALSE(parse_chain("[w X' b Y Z X t]"));
}

TEST(ErrorFunction, CubicPassesThroughItsNodesWithoutCurvatureAtItsEnds) {
  const ErrorFunction f({0.0, 0.1, 0.3, 0.4}, {1.0, -2.0, 0.5, 3.0}, Shape::Cubic);
  EXPECT_DOUBLE_EQ(f.at(0.1), -2.0);
  EXPECT_DOUBLE_EQ(f.at(0.4), 3.0);
  const double h = 1e-3;
  EXPECT_NEAR((f.at(0.0) - 2.0 * f.at(h) + f.at(2 * h)) / (h * h), 0.0,
              12.0);  // increases from 0 with slope ~1e4
  const double left = (f.at(0.1) - f.at(0.1 - 1e-7)) / 1e-7;
  const double right = (f.at(0.1 + 1e-7) - f.at(0.1)) / 1e-7;
  EXPECT_NEAR(left, right, 1e-3);
}

TEST(ErrorFunction, CubicAgreesWithTheReferenceCase) {
  const TruthMachine machine = test::reference_machine(Shape::Cubic);
  for (const auto& row :
       test::read_rows(std::string(ABBE_TEST_DATA) + "/otf/caseA_V_cubic_at_points.csv")) {
    const Eigen::Vector3d q(std::stod(row[0]), std::stod(row[1]), std::stod(row[2]));
    const Eigen::Vector3d linear(std::stod(row[3]), std::stod(row[4]), std::stod(row[5]));
    // The file contains the linear model; the exact transforms differ by at most 0.052 um in this
    // case.
    EXPECT_LT((error_m(machine, q) - linear).norm(), 0.06e-6);
  }
}

TEST(RandomTruth, HasTheRequestedMeanError) {
  const TruthMachine machine = random_truth(small_machine(), {.seed = 7, .mean_error_m = 100e-6});
  EXPECT_NEAR(mean_error_m(machine), 100e-6, 1e-9);
}

TEST(RandomTruth, IsEqualForEqualSeedsAndDiffersForOtherSeeds) {
  const auto csv = [](std::uint64_t seed) {
    return format_truth_csv(random_truth(small_machine(), {.seed = seed}));
  };
  EXPECT_EQ(csv(3), csv(3));
  EXPECT_NE(csv(3), csv(4));
}

TEST(RandomTruth, GeneratesAllTwentyOneErrors) {
  const TruthMachine machine = random_truth(small_machine(), {});
  for (const Axis axis : kAxes) {
    for (std::size_t m = 0; m < kMotions; ++m) {
      const auto values = machine.axis(axis).error[m].values();
      EXPECT_TRUE(
          std::any_of(values.begin(), values.end(), [](double v) { return std::abs(v) > 1e-7; }));
    }
  }
  EXPECT_NE(machine.squareness.A0Z_rad * machine.squareness.B0Z_rad * machine.squareness.C0Y_rad,
            0.0);
}

TEST(RandomTruth, PositioningAndRotationsAreZeroAtTheReference) {
  const TruthMachine machine = random_truth(small_machine(), {});
  // Z's range ends at its reference, so all three straightnesses of Z vanish there; those of X and
  // Y need not.
  EXPECT_EQ(machine.axis(Axis::X).error[0].at(0.0), 0.0);
  EXPECT_EQ(machine.axis(Axis::X).error[4].at(0.0), 0.0);
  EXPECT_NEAR(machine.axis(Axis::X).error[1].at(-0.3), 0.0, 1e-18);
}

TEST(TruthCsv, IsReadAsItWasWritten) {
  const TruthMachine truth = random_truth(small_machine(), {.backlash_m = 1e-6});
  const auto again =
      parse_truth_csv(format_truth_csv(truth), "truth.csv", small_machine(), Shape::Linear);
  ASSERT_TRUE(again) << again.error().text;
  const Eigen::Vector3d q(0.123, -0.2, -0.31);
  const MachineCondition condition{{1, -1, 1}, 0.0};
  EXPECT_LT((error_m(*again, q, condition) - error_m(truth, q, condition)).norm(), 1e-16);
}

TEST(TruthCsv, OfASpreadsheetIsRefusedByName) {
  const auto truth = parse_truth_csv("name;position_mm;value;unit\nEXX;0;1,5;um\n", "t.csv",
                                     small_machine(), Shape::Linear);
  ASSERT_FALSE(truth);
  EXPECT_THAT(truth.error().text, testing::HasSubstr("t.csv:1:5: semicolons"));
  EXPECT_THAT(truth.error().text, testing::HasSubstr("t.csv:2:7: \"1,5\" has a decimal comma"));
}

TEST(TruthCsv, NamesEveryBadLine) {
  const auto truth = parse_truth_csv(
      "name,position_mm,value,unit\nEXX,0,1,um\nEXX,0,2,um\nEQX,0,1,um\nEAX,0,1,um\nEYX,0,nan,um\n",
      "bad.csv", small_machine(), Shape::Linear);
  ASSERT_FALSE(truth);
  EXPECT_THAT(truth.error().text, testing::HasSubstr("bad.csv:3:1: position_mm"));
  EXPECT_THAT(truth.error().text, testing::HasSubstr("bad.csv:4:1: name: \"EQX\": unknown"));
  EXPECT_THAT(truth.error().text, testing::HasSubstr("bad.csv:5:1: unit: \"um\" instead of"));
  EXPECT_THAT(truth.error().text, testing::HasSubstr("bad.csv:6:7: value: \"nan\""));
}

}  // namespace
}  // namespace abbe::sim
