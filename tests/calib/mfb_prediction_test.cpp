#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>

#include "abbe/calib/internal/mfb/observe/pass_touches.hpp"
#include "abbe/calib/internal/mfb/observe/quick_extraction.hpp"
#include "abbe/calib/mfb/identify/monte_carlo.hpp"
#include "abbe/calib/mfb/plan/plan_prediction.hpp"
#include "mfb_simulation.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::mfb;
using namespace abbe::tests::mfb;
using testing::IsEmpty;
using testing::UnorderedElementsAre;

Bar nominal_bar() {
  std::vector<Vector3> O_m;
  const TouchPattern pattern = paper_pattern();
  for (std::size_t i = 0; i < pattern.holes(); ++i) {
    O_m.emplace_back(pattern.hole_x_m[i], pattern.hole_y_m[i], 0.0);
  }
  return bar_with(O_m);
}

Plan without(Plan plan, const std::vector<std::string>& names) {
  std::erase_if(plan.measurements, [&](const Measurement& m) {
    return std::find(names.begin(), names.end(), m.name) != names.end();
  });
  return plan;
}

PlanPrediction prediction_of(const Plan& plan) {
  auto p = predict(nominal_bar(), plan, paper_machine());
  EXPECT_TRUE(p) << p.error().text;
  return *std::move(p);
}

double rms_u(const PlanPrediction& p, const std::string& name) {
  return std::find_if(p.errors.begin(), p.errors.end(),
                      [&](const ErrorUncertainty& e) { return e.name == name; })
      ->rms_u;
}

TEST(MfbPrediction, OfThePaperShowsAllErrors) {
  const PlanPrediction p = prediction_of(paper_plan());
  EXPECT_EQ(p.errors.size(), 21u);
  EXPECT_THAT(p.not_seen, IsEmpty());
  EXPECT_EQ(p.rank, p.unknowns);
  EXPECT_EQ(p.observations, 17u * 36u);
  EXPECT_LT(p.worst, 1.0);
}

TEST(MfbPrediction, IsBetterWithX3Rolled) {
  Plan rolled = paper_plan();
  for (Measurement& m : rolled.measurements) {
    if (m.name == "X3") {
      m.bar_z = Vector3::UnitY();
      m.tool_offset_m = Vector3(0.0, -0.1, -0.15);
    }
  }
  const PlanPrediction as_paper = prediction_of(paper_plan()), better = prediction_of(rolled);
  EXPECT_NEAR(rms_u(as_paper, "EZX"), 0.46e-6, 0.01e-6);  // the specification, section 4
  EXPECT_NEAR(rms_u(as_paper, "EB0Z"), 1.85e-6, 0.02e-6);
  EXPECT_LT(rms_u(better, "EZX"), 0.26e-6);
  EXPECT_LT(rms_u(better, "EB0Z"), 1.405e-6);
}

TEST(MfbPrediction, NamesErrorsThatAPlanDoesNotShow) {
  EXPECT_THAT(prediction_of(without(paper_plan(), {"Y3-", "Z2-", "DXY2", "DXZ2", "DYZ2"})).not_seen,
              IsEmpty());  // the least plan: 12 measurements

  const auto no_x3 = prediction_of(without(paper_plan(), {"X3"}));
  EXPECT_THAT(no_x3.not_seen, UnorderedElementsAre("EXX", "ECX", "EC0Y"));
  const auto no_diagonals =
      prediction_of(without(paper_plan(), {"DXY1", "DXY2", "DXZ1", "DXZ2", "DYZ1", "DYZ2"}));
  EXPECT_THAT(no_diagonals.not_seen, testing::IsSupersetOf({"EA0Z", "EB0Z", "EC0Y"}));
  EXPECT_EQ(no_diagonals.rank, no_diagonals.unknowns);  // the rank does not show it
  EXPECT_NEAR(rms_u(no_diagonals, "EB0Z"), 100e-6, 30e-6);

  const auto one_tool = prediction_of(without(paper_plan(), {"Y3-", "Z1-", "Z2-"}));
  EXPECT_LT(one_tool.rank, one_tool.unknowns);
  EXPECT_THAT(one_tool.not_seen, testing::IsSupersetOf({"EAZ", "EBZ", "ECZ"}));
}

TEST(MfbPrediction, OfPositionsEqualsThatOfThePlan) {
  const Plan plan = paper_plan();
  const PlanPrediction whole = prediction_of(plan);
  const auto predictor = PlanPredictor::of(nominal_bar(), plan, paper_machine());
  ASSERT_TRUE(predictor) << predictor.error().text;
  std::map<std::string, std::vector<Measurement>> positions;
  for (const Measurement& m : plan.measurements) {
    positions[m.position].push_back(m);
  }
  std::vector<PositionInformation> parts;
  for (const auto& [name, passes] : positions) {
    const auto part = predictor->position(passes);
    ASSERT_TRUE(part) << part.error().text;
    parts.push_back(*part);
  }
  std::vector<const PositionInformation*> pointers;
  for (const PositionInformation& part : parts) {
    pointers.push_back(&part);
  }
  EXPECT_LT((predictor->predict(pointers).u() - whole.u()).norm(), 1e-9 * whole.u().norm());
}

TEST(MfbPrediction, RefusesAPlanBesideTheMachine) {
  Plan plan = paper_plan();
  plan.measurements[2].origin_m.x() += 0.1;
  const auto refused = predict(nominal_bar(), plan, paper_machine());
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().text, testing::StartsWith("X3: "));
}

TEST(MfbPrediction, EqualsTheUncertaintyOfTheIdentification) {
  std::mt19937_64 random(51);
  const SimulatedMachine machine(random);
  const Plan plan = paper_plan();
  const ProbedBar probed = probe(machine, plan, random);
  const auto found = identify(probed.bar, plan, probed.touches, paper_machine());
  ASSERT_TRUE(found) << found.error().text;
  const Eigen::VectorXd u = prediction_of(plan).u();
  const Eigen::VectorXd achieved = found->solution.covariance.diagonal().cwiseMax(0).cwiseSqrt();
  for (Eigen::Index i = 0; i < u.size(); ++i) {
    EXPECT_NEAR(achieved(i), u(i), 0.1 * u(i)) << i;  // the bar stands 1 mm beside the plan
  }
}

TEST(MfbMonteCarlo, AgreesWithTheFirstOrder) {
  std::mt19937_64 random(52);
  const SimulatedMachine machine(random);
  const Plan plan = paper_plan();
  const ProbedBar probed = probe(machine, plan, random);
  const auto o = observe(probed.bar, plan, probed.touches, paper_machine());
  ASSERT_TRUE(o) << o.error().text;
  const auto solution = solve(*o);
  ASSERT_TRUE(solution) << solution.error().text;

  const auto mc = monte_carlo(*o, *solution, {}, {.trials = 100, .seed = 4});
  ASSERT_TRUE(mc) << mc.error().text;
  EXPECT_NEAR(mc->scatter_of_ratio, 0.0711, 1e-4);
  EXPECT_NEAR(mc->mean_ratio, 1.0, mc->scatter_of_ratio);
  EXPECT_GT(mc->smallest_ratio, 1.0 - 5.0 * mc->scatter_of_ratio);
  EXPECT_LT(mc->largest_ratio, 1.0 + 5.0 * mc->scatter_of_ratio);
  const Eigen::VectorXd u = solution->covariance.diagonal().cwiseMax(0.0).cwiseSqrt();
  for (Eigen::Index i = 0; i < u.size(); ++i) {  // the mean of 100 trials
    EXPECT_LE(std::abs(mc->mean_error(i)), 0.5 * u(i) + 1e-15) << i;
  }

  const auto again = monte_carlo(*o, *solution, {}, {.trials = 100, .seed = 4});
  EXPECT_EQ(again->standard_deviation, mc->standard_deviation);
  EXPECT_FALSE(monte_carlo(*o, *solution, {}, {.trials = 1}));
}

TEST(MfbMonteCarlo, ExtractsTheSamePointsOfInterest) {
  const TouchPattern pattern = paper_pattern();
  std::mt19937_64 random(53);
  std::normal_distribution<double> normal(0.0, 20e-6);
  std::vector<std::size_t> places;
  std::vector<Vector3> tips_m;
  const std::vector<NominalTouch> nominal = nominal_touches(pattern, 1.5e-3);
  for (std::size_t k = 0; k < nominal.size(); ++k) {
    if (k % 50 != 7) {  // some touches are missing
      places.push_back(k);
      tips_m.emplace_back(nominal[k].tip_m +
                          Vector3(normal(random), normal(random), normal(random)));
    }
  }
  QuickExtraction quick(pattern, 1.5e-3, places);
  const auto found = quick(tips_m);
  const auto expected =
      points_of_interest(bar_touches(pattern, places, tips_m), Matrix3::Identity());
  ASSERT_TRUE(found && expected);
  for (std::size_t i = 0; i < pattern.holes(); ++i) {
    EXPECT_LT((found->O_m[i] - expected->O_m[i]).norm(), 1e-12) << i;
  }
  EXPECT_LT((found->pose.axes - expected->axes).norm(), 1e-12);
}

}  // namespace
