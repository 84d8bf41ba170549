/// Runs of one tracker with one offset of its ranges, in a joint identification (joint/part.hpp,
/// TrackerPlace) and in updates of a model (model_update.hpp).

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "abbe/calib/model/model_update.hpp"
#include "joint_parts.hpp"
#include "repetitions.hpp"

namespace {
namespace joint = abbe::calib::joint;
namespace otf = abbe::calib::otf;
using abbe::calib::TrackerPlace;
using abbe::calib::VolumetricModel;
using abbe::tests::otf::MadeRun;
using abbe::tests::otf::make_run;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr double kUOffset_m = 50e-6;

/// A run whose ranges are all too long by `offset_m`, with the prior `u_m`.
MadeRun run_with_offset(double offset_m, unsigned noise_seed, double u_m = kUOffset_m) {
  MadeRun run =
      make_run({.seed = 3, .noise_seed = noise_seed, .error_scale_m = 10e-6, .in_datum = true});
  for (otf::TrackerObservation& sample : run.samples) {
    sample.p_tracker_m *= 1.0 + offset_m / sample.p_tracker_m.norm();
  }
  run.noise.u_range_offset_m = u_m;
  return run;
}

otf::Solution solution_of(const MadeRun& run) {
  return otf::identify(run.samples, run.machine, run.path, run.noise, run.options)->solution;
}

/// Of run_with_offset() with the usual prior, each identified once.
const otf::Solution& solution_with_offset(double offset_m, unsigned noise_seed) {
  static std::map<std::pair<double, unsigned>, otf::Solution> found;
  const std::pair key(offset_m, noise_seed);
  if (const auto one = found.find(key); one != found.end()) {
    return one->second;
  }
  return found.emplace(key, solution_of(run_with_offset(offset_m, noise_seed))).first->second;
}

joint::Part part_of(const std::string& name, const otf::Solution& solution,
                    const joint::CommonTables& common, const std::string& offset) {
  joint::CommonEffects effects;
  if (!offset.empty()) {
    effects.place = TrackerPlace{offset, *solution.offset_in_model};
  }
  return *joint::part_of_run(name, solution.model, common, effects);
}

/// Largest difference of two covariances in units of the standard uncertainties of the first.
double difference_in_u(const VolumetricModel& a, const VolumetricModel& b) {
  const Eigen::VectorXd u = a.covariance().diagonal().cwiseSqrt().cwiseMax(1e-12).cwiseInverse();
  return (u.asDiagonal() * (a.covariance() - b.covariance()) * u.asDiagonal())
      .cwiseAbs()
      .maxCoeff();
}

TEST(OffsetOfAPlace, OfOneRunAloneIsItsOwn) {
  const otf::Solution& run = solution_with_offset(30e-6, 1);
  const joint::CommonTables common = *joint::tables_of(run.model);
  const std::vector with{part_of("run", run, common, "home 1")},
      without{part_of("run", run, common, "")};
  const auto shared = joint::joint_model(with, common), own = joint::joint_model(without, common);
  ASSERT_TRUE(shared) << shared.error().text;
  ASSERT_TRUE(own) << own.error().text;
  EXPECT_LT(difference_in_u(own->model, shared->model), 1e-6);
  const Eigen::VectorXd u = own->model.covariance().diagonal().cwiseSqrt();
  for (Eigen::Index i = 0; i < u.size(); ++i) {
    EXPECT_NEAR(shared->model.U()(i), own->model.U()(i), 1e-6 * u(i) + 1e-15);
  }
  ASSERT_EQ(shared->effects.size(), 1u);
  EXPECT_EQ(shared->effects[0].name, "offset of the ranges home 1");
  EXPECT_NEAR(shared->effects[0].value * kUOffset_m, run.range_offset.value_m, 1e-10);
  EXPECT_NEAR(shared->effects[0].u * kUOffset_m, run.range_offset.u_m, 1e-10);
}

/// Two runs know the common offset better than one: by 1 / sqrt(2) where the prior does not count.
TEST(OffsetOfAPlace, OfTwoRunsIsKnownFromBothAndThePriorCountsOnce) {
  constexpr double kOffset_m = 30e-6;
  const otf::Solution &one = solution_with_offset(kOffset_m, 1),
                      &two = solution_with_offset(kOffset_m, 2);
  const joint::CommonTables common = *joint::tables_of(one.model);
  const std::vector parts{part_of("run 1", one, common, "home 1"),
                          part_of("run 2", two, common, "home 1")};
  const auto result = joint::identify(parts, common);
  ASSERT_TRUE(result) << result.error().text;
  ASSERT_THAT(result->contradictions, IsEmpty());
  const joint::EffectEstimate& offset = result->joint->effects.front();
  const auto of_data = [](const otf::Solution& s) {
    return 1.0 / std::pow(s.range_offset.u_m, 2) - 1.0 / std::pow(kUOffset_m, 2);
  };
  // The tables of both are the same: together they know the offset at least as well as both alone.
  const double least = of_data(one) + of_data(two) + 1.0 / std::pow(kUOffset_m, 2);
  EXPECT_GE(1.0 / std::pow(offset.u * kUOffset_m, 2), least * (1.0 - 1e-6));
  EXPECT_NEAR(offset.value * kUOffset_m, kOffset_m, 4.0 * offset.u * kUOffset_m);
}

/// Runs of another home position have another offset: named as the same, they contradict.
TEST(OffsetOfAPlace, ThatIsNotSharedIsAContradiction) {
  const otf::Solution &one = solution_with_offset(60e-6, 1), &two = solution_with_offset(-60e-6, 2);
  const joint::CommonTables common = *joint::tables_of(one.model);
  const auto contradictions = [&](const std::string& first, const std::string& second) {
    const std::vector parts{part_of("run 1", one, common, first),
                            part_of("run 2", two, common, second)};
    return joint::identify(parts, common)->contradictions;
  };
  // Lengths differ, too, but a wrong scale is no cause of it.
  EXPECT_THAT(contradictions("home 1", "home 1"),
              ElementsAre(HasSubstr("contradict each other"),
                          HasSubstr("; this alone does not explain their difference")));
  EXPECT_THAT(contradictions("home 1", "home 2"), IsEmpty());
}

/// Four pairs of runs with a common offset: 31 combinations each, the mean scatters by 0.13.
TEST(OffsetOfAPlace, UncertaintyIsHonest) {
  double normalised = 0.0;
  constexpr unsigned kPairs = abbe::tests::repetitions(4u);
  std::mt19937_64 random(4);
  std::normal_distribution<double> normal;
  for (unsigned pair = 0; pair < kPairs; ++pair) {
    const double offset_m = kUOffset_m * normal(random);
    const MadeRun first = run_with_offset(offset_m, 10 + 2 * pair);
    const otf::Solution one = solution_of(first),
                        two = solution_of(run_with_offset(offset_m, 11 + 2 * pair));
    const joint::CommonTables common = *joint::tables_of(one.model);
    const std::vector parts{part_of("run 1", one, common, "home 1"),
                            part_of("run 2", two, common, "home 1")};
    const auto joint = joint::joint_model(parts, common);
    ASSERT_TRUE(joint) << joint.error().text;
    const Eigen::VectorXd error = joint->model.U() - first.truth;
    const Eigen::MatrixXd C = joint->model.covariance();
    const auto inverse = C.completeOrthogonalDecomposition();
    const double of_pair = error.dot(inverse.solve(error)) / static_cast<double>(inverse.rank());
    EXPECT_GT(of_pair, 0.0);
    EXPECT_LT(of_pair, 10.0);
    normalised += of_pair / kPairs;
  }
  RecordProperty("mean_squared_normalised_error", std::to_string(normalised));
  if (abbe::tests::kAllRepetitions) {
    EXPECT_NEAR(normalised, 1.0, 0.3);
  }
}

TEST(OffsetOfAPlace, NeedsAnEstimateOfTheRun) {
  const MadeRun run = make_run({.seed = 3});
  const otf::Solution solution = solution_of(run);
  EXPECT_FALSE(solution.offset_in_model);
  const joint::CommonTables common = *joint::tables_of(solution.model);
  const auto part =
      joint::part_of_run("run", solution.model, common, {.place = TrackerPlace{"home 1", {}}});
  ASSERT_FALSE(part);
  EXPECT_THAT(part.error().text, HasSubstr("run has no estimate of the range offset 'home 1'"));
}

abbe::calib::ModelWithOffset with_offset(const otf::Solution& solution) {
  return {solution.model, solution.offset_in_model};
}

double squared_normalised_error(const VolumetricModel& model, const MadeRun& truth) {
  const Eigen::VectorXd error = model.U() - truth.truth;
  const auto inverse = model.covariance().completeOrthogonalDecomposition();
  return error.dot(inverse.solve(error)) / static_cast<double>(inverse.rank());
}

TEST(RangeOffsetOfUpdates, IsThatOfTheJointIdentification) {
  const otf::Solution &one = solution_with_offset(30e-6, 1), &two = solution_with_offset(30e-6, 2);
  const joint::CommonTables common = *joint::tables_of(one.model);
  const std::vector parts{part_of("run 1", one, common, "home 1"),
                          part_of("run 2", two, common, "home 1")};
  const auto joint = joint::joint_model(parts, common);
  const auto updated = update_model(with_offset(one), with_offset(two), {});
  ASSERT_TRUE(joint) << joint.error().text;
  ASSERT_TRUE(updated) << updated.error().text;

  EXPECT_LT(difference_in_u(joint->model, updated->model), 1e-6);
  const Eigen::VectorXd u = joint->model.covariance().diagonal().cwiseSqrt();
  EXPECT_LT((updated->model.U() - joint->model.U())
                .cwiseQuotient(u.cwiseMax(1e-12))
                .cwiseAbs()
                .maxCoeff(),
            1e-5);
  ASSERT_TRUE(updated->range_offset);
  EXPECT_NEAR(updated->range_offset->value_m, joint->effects[0].value * kUOffset_m, 1e-10);
  EXPECT_NEAR(updated->range_offset->u_m, joint->effects[0].u * kUOffset_m, 1e-10);
}

/// Runs from one place, which determine the offset hardly better than its prior: one that counts as
/// new in each of them would seem to average out.
TEST(RangeOffsetOfUpdates, DoesNotAverageOut) {
  constexpr double kU_m = 0.3e-6, kOffset_m = 0.45e-6;
  constexpr unsigned kRuns = abbe::tests::repetitions(20u);
  const MadeRun first = run_with_offset(kOffset_m, 1, kU_m);
  abbe::calib::ModelWithOffset with = with_offset(solution_of(first)), without{with.model};
  for (unsigned k = 2; k <= kRuns; ++k) {
    const otf::Solution run = solution_of(run_with_offset(kOffset_m, k, kU_m));
    auto updated = update_model(with, with_offset(run), {});
    ASSERT_TRUE(updated) << updated.error().text;
    with = *std::move(updated);
    without = *update_model(without, {run.model}, {});
  }
  const double kept = squared_normalised_error(with.model, first),
               lost = squared_normalised_error(without.model, first);
  RecordProperty("kept", std::to_string(kept));
  RecordProperty("lost", std::to_string(lost));
  if (abbe::tests::kAllRepetitions) {
    EXPECT_NEAR(kept, 1.0, 0.5);
    EXPECT_GT(lost, 1.5 * kept);
  }
  EXPECT_NEAR(with.range_offset->value_m, kOffset_m, 4.0 * with.range_offset->u_m);
}

TEST(RangeOffsetOfUpdates, OfAnotherPlaceIsNotTheSame) {
  const otf::Solution &one = solution_with_offset(60e-6, 1), &two = solution_with_offset(-60e-6, 2);
  const auto refused = update_model(with_offset(one), with_offset(two), {});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, abbe::calib::ErrorCode::NotApplicable);
  EXPECT_THAT(refused.error().text, HasSubstr("give the place a new name"));

  // Under its new name, and for a run that states no offset, the covariance contains it.
  const auto new_place = update_model({one.model}, with_offset(two), {});
  ASSERT_TRUE(new_place) << new_place.error().text;
  EXPECT_NEAR(new_place->range_offset->value_m, -60e-6, 4.0 * new_place->range_offset->u_m);
  const auto without = update_model(with_offset(one), {two.model}, {});
  ASSERT_TRUE(without) << without.error().text;
  EXPECT_FALSE(without->range_offset);
}

/// Backlash adds unknowns that are no parameters of the model.
TEST(RangeOffsetOfUpdates, HasOneDerivativeForEachParameterWithBacklash) {
  MadeRun run = run_with_offset(30e-6, 1);
  run.options.backlash = abbe::calib::TravelDependence::Backlash;
  const otf::Solution solution = solution_of(run);
  ASSERT_TRUE(solution.offset_in_model);
  EXPECT_EQ(solution.offset_in_model->dU_dd.size(), solution.model.U().size());
}

/// Forgotten information lets the offset follow a slow change.
TEST(RangeOffsetOfUpdates, IsForgottenAsTheTablesAre) {
  const otf::Solution &one = solution_with_offset(30e-6, 1), &two = solution_with_offset(30e-6, 2);
  const auto all = update_model(with_offset(one), with_offset(two), {});
  const auto half = update_model(with_offset(one), with_offset(two), {.forgetting = 0.5});
  ASSERT_TRUE(all && half);
  EXPECT_GT(half->range_offset->u_m, 1.1 * all->range_offset->u_m);
  EXPECT_LE(half->range_offset->u_m, two.range_offset.u_m);
}

TEST(RangeOffsetOfUpdates, OfAnotherNumberOfParametersIsRefused) {
  const otf::Solution& run = solution_with_offset(60e-6, 1);
  auto damaged = with_offset(run);
  damaged.range_offset->dU_dd.conservativeResize(3);
  const auto refused = update_model(damaged, with_offset(run), {});
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().text, HasSubstr("3 derivatives for "));
}

}  // namespace
