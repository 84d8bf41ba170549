/// The judgement of an identification with a Multi-Feature Bar, on a simulated machine.

#include "abbe/calib/mfb/judge/judge.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <functional>
#include <random>
#include <set>
#include <string>

#include "mfb_simulation.hpp"
#include "repetitions.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::mfb;
using namespace abbe::tests::mfb;
using abbe::tests::kAllRepetitions;
using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;

Identification identified(unsigned seed, const Plan& plan = paper_plan(),
                          const ProbingOptions& options = {}) {
  std::mt19937_64 random(seed);
  const SimulatedMachine machine(random);
  const ProbedBar probed = probe(machine, plan, random, options);
  auto found = identify(probed.bar, plan, probed.touches, paper_machine());
  EXPECT_TRUE(found) << found.error().text;
  return *std::move(found);
}

const Identification& usual_identification() {
  static const Identification found = identified(5);
  return found;
}

HeldOutFigures figures_of(const Identification& found, const VolumetricModel* active = nullptr) {
  return held_out(found.observations, found.solution, active).value();
}

VolumetricModel with_tables(const Identification& found, const Eigen::VectorXd& U) {
  return VolumetricModel::from_vector(found.observations.basis, ModelDatum::G1,
                                      found.model.tool_offsets_m(), U, found.solution.covariance,
                                      found.model.validity())
      .value();
}

/// The plan without all measurements except those of these names.
Plan with_measurements(const Plan& plan, const std::set<std::string>& names) {
  Plan out = plan;
  std::erase_if(out.measurements, [&](const Measurement& m) { return !names.contains(m.name); });
  return out;
}

TEST(MfbJudge, AcceptsAModelOfAnUndisturbedMeasurement) {
  const auto verdict = judge(usual_identification(), nullptr);
  ASSERT_TRUE(verdict) << verdict.error().text;
  EXPECT_TRUE(verdict->accepted) << testing::PrintToString(verdict->reasons);
  EXPECT_GT(verdict->held_out.no_compensation, 10 * verdict->held_out.candidate);
}

// A left-out point differs from its prediction by its own noise and by that of the prediction,
// which is at most ten times as large for a single point, and about as large in the mean.
TEST(MfbJudge, LeavesOutPointsThatTheOthersPredict) {
  const HeldOutFigures figures = figures_of(usual_identification());
  const std::size_t all = 3 * 12 * usual_identification().observations.passes.size();
  EXPECT_EQ(figures.observations + figures.not_held_out, all);
  EXPECT_LT(figures.not_held_out, all / 10);
  EXPECT_GT(figures.candidate, 1.0);
  EXPECT_LT(figures.candidate, 3.0);
}

TEST(MfbJudge, LeavesOutPointsOfTheShortestPlan) {
  const Plan shortest = with_measurements(paper_plan(), {"X1", "X2", "X3", "Y1", "Y2", "Y3+", "Z1+",
                                                         "Z1-", "Z2+", "DXY1", "DXZ1", "DYZ1"});
  const auto verdict = judge(identified(6, shortest), nullptr);
  ASSERT_TRUE(verdict) << verdict.error().text;
  EXPECT_TRUE(verdict->accepted) << testing::PrintToString(verdict->reasons);
  EXPECT_GT(verdict->held_out.observations, 300u);
}

// The left-out point must not be known to the prediction: an error of a point shows in full.
TEST(MfbJudge, SeesTheWholeErrorOfAPoint) {
  constexpr double kError_m = 30e-6;
  Identification wrong = usual_identification();
  wrong.observations.passes[0].delta_m(3 * 5) += kError_m;  // x of hole 6 of X1
  const HeldOutFigures before = figures_of(usual_identification()), after = figures_of(wrong);
  const auto squares = [](const HeldOutFigures& f) {
    return f.candidate_rms_m * f.candidate_rms_m * static_cast<double>(f.observations);
  };
  EXPECT_GT(squares(after) - squares(before), 0.9 * kError_m * kError_m);
}

TEST(MfbJudge, ComparesWithTheActiveModelAtTheSamePoints) {
  const Identification& found = usual_identification();
  const VolumetricModel nothing =
      with_tables(found, Eigen::VectorXd::Zero(found.solution.U.size()));
  const HeldOutFigures of_nothing = figures_of(found, &nothing);
  ASSERT_TRUE(of_nothing.active);
  EXPECT_GT(of_nothing.observations_beside_active, 100u);

  // A model without errors leaves what no compensation leaves, apart from the points at the rim.
  EXPECT_NEAR(*of_nothing.active, of_nothing.no_compensation, 0.1 * of_nothing.no_compensation);
  EXPECT_LT(*of_nothing.candidate_beside_active, 0.1 * *of_nothing.active);

  const HeldOutFigures of_itself = figures_of(found, &found.model);
  EXPECT_LT(*of_itself.active, *of_itself.candidate_beside_active) << "it was fitted to the points";
}

// Other passes of the plan have tools for which the active model has no values.
TEST(MfbJudge, ComparesWithAnActiveModelOfOneTool) {
  const Identification& found = usual_identification();
  const std::vector<Vector3> one_tool{found.observations.plan.measurements.front().tool_offset_m};
  const auto model = VolumetricModel::from_vector(
      found.observations.basis, ModelDatum::G1, one_tool, found.solution.U,
      found.solution.covariance, found.model.validity());
  const HeldOutFigures figures = figures_of(found, &*model);
  ASSERT_TRUE(figures.active);
  EXPECT_LT(*figures.active, *figures.candidate_beside_active);
  EXPECT_GT(figures.observations_beside_active, 3u * 12u * 5u) << "X1, X2, Y1, Y2, DXY1, DXY2";
  EXPECT_LT(figures.observations_beside_active, figures.observations / 2);
}

TEST(MfbJudge, ComparesAlongAllAxesWithAnActiveModelOfTheSameVolume) {
  const HeldOutFigures figures = figures_of(usual_identification(), &usual_identification().model);
  EXPECT_GT(figures.observations_beside_active, figures.observations * 9 / 10);
}

TEST(MfbJudge, RefusesTooManyTouchesThatWereSetAside) {
  Identification found = usual_identification();
  found.set_aside.assign(60, {0, "X1", {Feature::Hole, 4, Side::Left, 2}, 52e-6});
  EXPECT_THAT(judge(found, nullptr)->causes, ElementsAre("outliers"));
}

TEST(MfbJudge, KeepsAnActiveModelThatIsAsGood) {
  const Identification& found = usual_identification();
  const auto verdict = judge(found, &found.model);
  ASSERT_TRUE(verdict) << verdict.error().text;
  EXPECT_THAT(verdict->causes, ElementsAre("held-out"));
}

TEST(MfbJudge, RefusesWhatTheStatedNoiseDoesNotExplain) {
  ProbingOptions options;
  options.noise = 2.0;
  const Identification found = identified(7, paper_plan(), options);
  const auto verdict = judge(found, nullptr);
  ASSERT_TRUE(verdict) << verdict.error().text;
  EXPECT_FALSE(verdict->accepted);
  EXPECT_THAT(verdict->reasons.front(), HasSubstr("chi-square per degree of freedom"));
  EXPECT_EQ(verdict->causes.size(), verdict->reasons.size());
}

TEST(MfbJudge, NotesTouchesThatWereSetAside) {
  Identification found = usual_identification();
  found.set_aside.push_back({0, "X1", {Feature::Hole, 4, Side::Left, 2}, 52e-6});
  const auto verdict = judge(found, nullptr);
  ASSERT_TRUE(verdict) << verdict.error().text;
  EXPECT_THAT(verdict->notes,
              Contains(HasSubstr("X1: hole 5, k = 2 is excluded: it is 52 um off its feature")));
}

TEST(MfbJudge, AsksByNameForABarThatIsFarFrom20C) {
  const auto at = [](double temperature_C) {
    Identification found = usual_identification();
    found.observations.bar.expansion = Expansivity{11.5e-6, 0.2e-6};
    for (PassObservation& pass : found.observations.passes) {
      pass.temperature_K = temperature_C + 273.15;
    }
    return found;
  };
  for (const double temperature_C : {68.9, 35.0, 45.0, -4.0}) {
    const Identification found = at(temperature_C);
    const auto verdict = judge(found, nullptr).value();
    EXPECT_THAT(verdict.causes, Contains(std::string(kBarTemperature)));
    EXPECT_THAT(verdict.reasons, Contains(AllOf(HasSubstr("the temperature of the bar is "),
                                                HasSubstr(" um/m; check temperature_C"))));
    const auto accepted = judge(found, nullptr, {.accept_bar_temperature = true}).value();
    EXPECT_TRUE(accepted.accepted);
    EXPECT_THAT(accepted.notes, Contains(HasSubstr("explicitly accepted")));
  }
  EXPECT_TRUE(judge(at(31.0), nullptr)->accepted);
  EXPECT_TRUE(judge(at(9.0), nullptr)->accepted);
}

// With the fewest positions no residual shows that the bar was warmer at one of them.
TEST(MfbJudge, AsksByNameForABarThatWasWarmerAtOnePosition) {
  const auto positions = usual_identification().observations.positions.size();
  const auto with = [](const std::function<double(std::size_t position)>& off_K) {
    Identification found = usual_identification();
    found.observations.bar.expansion = Expansivity{11.5e-6, 0.2e-6};
    for (PassObservation& pass : found.observations.passes) {
      pass.temperature_K += off_K(pass.position);
    }
    return found;
  };
  for (const std::size_t at :
       {std::size_t{0}, std::size_t{1}, std::size_t{3}, positions - 2, positions - 1}) {
    for (const double by_K : {2.0, -6.0}) {
      if (!kAllRepetitions && (by_K > 0.0) != (at % 2 == 0)) {
        continue;  // each place with one of them
      }
      const Identification found = with(
          [&](std::size_t p) { return 0.1 * static_cast<double>(p) + (p == at ? by_K : 0.0); });
      const auto verdict = judge(found, nullptr).value();
      EXPECT_THAT(verdict.causes, ElementsAre(std::string(kBarTemperatureChange)));
      const auto& passes = found.observations.passes;
      const auto pass = std::ranges::find(passes, at, &PassObservation::position);
      EXPECT_THAT(
          verdict.reasons,
          ElementsAre(AllOf(HasSubstr(found.observations.plan.measurements[pass->measurement].name +
                                      ": the temperature of the bar is "),
                            HasSubstr(" K from that of the positions next to it: its "
                                      "lengths change by "))));
      EXPECT_TRUE(judge(found, nullptr, {.accept_bar_temperature_change = true})->accepted);
      EXPECT_FALSE(judge(found, nullptr, {.accept_bar_temperature = true})->accepted);
    }
  }
}

TEST(MfbJudge, AcceptsABarThatWarmsUpAndOneThatIsWarmerTheNextMorning) {
  const auto accepted = [](const std::function<double(double position)>& off_K) {
    Identification found = usual_identification();
    found.observations.bar.expansion = Expansivity{11.5e-6, 0.2e-6};
    for (PassObservation& pass : found.observations.passes) {
      pass.temperature_K += off_K(static_cast<double>(pass.position));
    }
    return judge(found, nullptr)->accepted;
  };
  EXPECT_TRUE(accepted([](double p) { return 0.8 * p - 5.0; }));
  EXPECT_TRUE(accepted([](double p) { return p < 5.0 ? 0.0 : 3.0; }));
  EXPECT_TRUE(accepted([](double p) { return p == 3.0 ? 0.5 : 0.0; }));
}

// Far from 20 C the uncertain expansion leaves no scale determined.
TEST(MfbJudge, NamesTheTemperatureThatLeavesTheScalesUndetermined) {
  Plan plan = paper_plan();
  for (Measurement& m : plan.measurements) {
    m.temperature_K = 273.15 + 68.9;
  }
  ProbingOptions options;
  options.expansion = Expansivity{11.5e-6, 0.8e-6};
  std::mt19937_64 random(9);
  const SimulatedMachine machine(random);
  const ProbedBar probed = probe(machine, plan, random, options);
  const auto found = identify(probed.bar, plan, probed.touches, paper_machine());
  ASSERT_FALSE(found);
  EXPECT_THAT(found.error().text,
              AllOf(HasSubstr("do not show EXX"), HasSubstr("the temperature of the bar is 68.9 C"),
                    HasSubstr("check temperature_C, in degrees Celsius, or measure in further "
                              "positions")));
}

TEST(MfbJudge, StatesOnWhatTheScaleDepends) {
  EXPECT_THAT(judge(usual_identification(), nullptr)->notes,
              Contains(HasSubstr("the scale of the model is that of the bar")));
}

TEST(MfbJudge, StatesThatTheSequenceIsNotFittedAgain) {
  std::mt19937_64 random(8);
  const SimulatedMachine machine(random);
  const Plan plan = paper_plan();
  const ProbedBar probed = probe(machine, plan, random, {});
  Options options;
  options.solve.estimator = Estimator::Sequential;
  const auto found = identify(probed.bar, plan, probed.touches, paper_machine(), options);
  ASSERT_TRUE(found) << found.error().text;
  const auto verdict = judge(*found, nullptr, {.solve = options.solve});
  ASSERT_TRUE(verdict) << verdict.error().text;
  EXPECT_THAT(verdict->notes, Contains(HasSubstr("estimated again")));
  EXPECT_GT(verdict->held_out.no_compensation, 2 * verdict->held_out.candidate);
}

}  // namespace
