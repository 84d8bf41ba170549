#include "abbe/calib/otf/judge/judge.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "abbe/calib/otf/identify/identify.hpp"
#include "otf_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::otf;
using namespace abbe::tests::otf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;

Identification identified(const MadeRun& run) {
  return *identify(run.samples, run.machine, run.path, run.noise, run.options);
}

TEST(Judge, AcceptsAModelOfTheMachineItWasMeasuredOn) {
  const MadeRun run = make_run({});
  const Identification id = identified(run);
  const auto verdict = judge(id.observations, id.solution, nullptr, {}, run.options);
  ASSERT_TRUE(verdict) << verdict.error().text;
  EXPECT_TRUE(verdict->accepted) << verdict->reasons.front();
  EXPECT_NEAR(verdict->held_out.candidate, 1.0, 0.05);
  EXPECT_GT(verdict->held_out.no_compensation, 10.0);
  EXPECT_FALSE(verdict->held_out.active);
}

TEST(Judge, RefusesAModelOfNoiseOnAPerfectMachine) {
  const MadeRun run = make_run({.error_scale_m = 0.0});
  const Identification id = identified(run);
  const auto verdict = judge(id.observations, id.solution, nullptr, {}, run.options);
  ASSERT_TRUE(verdict);
  EXPECT_FALSE(verdict->accepted);
  EXPECT_THAT(verdict->reasons, Contains(HasSubstr("without compensation")));
}

TEST(Judge, FindsTheActiveModelOfTheSameMachineAsGood) {
  const MadeRun first = make_run({.seed = 1});
  const Identification before = identified(first);
  const MadeRun second = make_run({.seed = 1, .noise_seed = 2});
  const auto held =
      held_out(identified(second).observations, &before.solution.model, second.options);
  ASSERT_TRUE(held);
  ASSERT_TRUE(held->active);
  EXPECT_NEAR(*held->active, 1.0, 0.05);
}

TEST(Judge, KeepsTheActiveModelOfAnUnchangedMachine) {
  const MadeRun first = make_run({.seed = 1}), second = make_run({.seed = 1, .noise_seed = 2});
  const VolumetricModel active = identified(first).solution.model;
  const Identification again = identified(second);
  const auto verdict = judge(again.observations, again.solution, &active, {}, second.options);
  ASSERT_TRUE(verdict);
  EXPECT_FALSE(verdict->accepted);
  EXPECT_THAT(verdict->reasons, ElementsAre(HasSubstr("the active model remains valid")));
}

TEST(Judge, PrefersANewModelToThatOfAnotherMachine) {
  const MadeRun run = make_run({.seed = 1}), other = make_run({.seed = 2});
  const Identification id = identified(run);
  const VolumetricModel active = identified(other).solution.model;
  const auto verdict = judge(id.observations, id.solution, &active, {}, run.options);
  ASSERT_TRUE(verdict);
  EXPECT_TRUE(verdict->accepted);
  EXPECT_GT(verdict->held_out.active.value(), 10.0);
}

TEST(Judge, ComparesWhereTheActiveModelHoldsOnly) {
  const MadeRun run = make_run({.seed = 1});
  const Identification id = identified(run);
  const VolumetricModel& m = id.solution.model;
  std::vector<Vector3> lower(m.validity().vertices_m().begin(), m.validity().vertices_m().end());
  const auto z_of = [](const Vector3& a, const Vector3& b) { return a.z() < b.z(); };
  const auto [low, high] = std::minmax_element(lower.begin(), lower.end(), z_of);
  const double bottom = low->z(), middle = 0.5 * (bottom + high->z());

  for (Vector3& v : lower) {
    v.z() = v.z() > middle ? middle : bottom;
  }

  // Right inside its volume, wrong above it, where it must not be used.
  Eigen::VectorXd U = m.U();
  const ParameterLayout& layout = m.tables()->layout();
  const auto& z_nodes = layout.nodes()[2].nodes_m;
  const std::vector<Parameter> parameters = m.parameters();

  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const auto motion = error_motion(parameters[i].name);
    const double node_m = parameters[i].position_m.value_or(bottom);
    const auto above = std::upper_bound(z_nodes.begin(), z_nodes.end(), middle);
    if (motion && motion->axis == Axis::Z && node_m > middle && above != z_nodes.end() &&
        node_m > *above) {
      U(static_cast<Eigen::Index>(i)) += 1e-3;
    }
  }

  const VolumetricModel active =
      *VolumetricModel::from_vector(layout, ModelDatum::G1, m.tool_offsets_m(), U, m.covariance(),
                                    *ValidityVolume::hull_of(lower));
  const auto held = held_out(id.observations, &active, run.options);
  ASSERT_TRUE(held);
  EXPECT_GT(held->observations_beside_active, 0u);
  EXPECT_LT(held->observations_beside_active, held->observations);
  EXPECT_LT(held->active.value(), 2.0);

  // Equally good inside the volume of the smaller one, and valid in a larger volume.
  EXPECT_THAT(judge(id.observations, id.solution, &active, {}, run.options)->notes,
              Contains(HasSubstr("outside its validity volume")));
}

TEST(Judge, DoesNotDependOnTheDatumOfTheActiveModel) {
  const MadeRun run = make_run({.seed = 1});
  const Identification id = identified(run);
  const VolumetricModel& model = id.solution.model;

  // The same machine in another datum: any unobservable combination is added.
  const Eigen::MatrixXd N =
      unobservable_combinations(model.tables()->layout(), std::array{run.machine.target_offset_m});
  const auto n = static_cast<Eigen::Index>(model.tables()->layout().model_size());
  const Eigen::VectorXd shift = N.rowwise().sum() / N.cwiseAbs().maxCoeff() * 1e-4;
  const VolumetricModel shifted = *VolumetricModel::from_vector(
      model.tables()->layout(), ModelDatum::G1, model.tool_offsets_m(), model.U() + shift.head(n),
      model.covariance(), model.validity());
  const double as_stated = held_out(id.observations, &model, run.options)->active.value();
  const double in_other_datum = held_out(id.observations, &shifted, run.options)->active.value();
  EXPECT_NEAR(in_other_datum, as_stated, 1e-6);
}

TEST(Judge, LeavesOutAnActiveModelOfAnotherTool) {
  const MadeRun run = make_run({});
  const Identification id = identified(run);
  const VolumetricModel& m = id.solution.model;
  const VolumetricModel other = *VolumetricModel::from_vector(m.tables()->layout(), ModelDatum::G1,
                                                              std::array{Vector3(0, 0, -0.5)},
                                                              m.U(), m.covariance(), m.validity());
  EXPECT_FALSE(held_out(id.observations, &other, run.options)->active);
}

/// Assigns every row of the parameter with the fewest rows to one fold; returns their number.
std::size_t give_a_node_to_one_fold(Observations& o, std::size_t folds) {
  std::vector<std::size_t> rows_of(o.basis.size(), 0);
  const auto each = [&](auto&& take) {
    for (std::size_t i = 0; i < o.rows.size(); ++i) {
      for (const auto& e : o.A.row(i)) {
        if (e.value != 0.0 && e.column < rows_of.size()) {
          take(o.rows[i], e.column);
        }
      }
    }
  };

  each([&](const Observation&, std::size_t column) { ++rows_of[column]; });
  const auto rarest = std::min_element(rows_of.begin(), rows_of.end());
  const auto column = static_cast<std::size_t>(rarest - rows_of.begin());

  each([&](Observation& row, std::size_t c) {
    if (c == column) {
      row.leg = row.leg / folds * folds;  // fold 0
    }
  });

  return *rarest;
}

TEST(Judge, HoldsOutNothingThatAloneTouchesANode) {
  const MadeRun run = make_run({});
  Identification id = identified(run);
  const std::size_t alone = give_a_node_to_one_fold(id.observations, run.options.held_out_folds);
  const auto held = held_out(id.observations, nullptr, run.options);
  ASSERT_TRUE(held) << held.error().text;
  EXPECT_GE(held->not_held_out, alone);
  EXPECT_EQ(held->observations + held->not_held_out, id.observations.rows.size());
  EXPECT_NEAR(held->candidate, 1.0, 0.1);
  EXPECT_THAT(judge(id.observations, id.solution, nullptr, {}, run.options)->notes,
              Contains(HasSubstr("were not held out")));
}

/// A volume that contains only a few observations of every fold: a rigid motion fits six of them
/// exactly with any model.
TEST(Judge, ComparesNothingWhereARigidMotionFitsAnyModel) {
  const MadeRun run = make_run({.seed = 1});
  const Identification id = identified(run);
  const VolumetricModel& m = id.solution.model;
  const Observation& row = id.observations.rows[id.observations.rows.size() / 2];
  const Vector3 at = id.observations.sub_points_m[row.first_sub_point + row.sub_points / 2];
  std::vector<Vector3> around;

  for (int corner = 0; corner < 8; ++corner) {
    const Vector3 d((corner & 1) != 0 ? 1 : -1, (corner & 2) != 0 ? 1 : -1,
                    (corner & 4) != 0 ? 1 : -1);
    around.emplace_back(at + 0.012 * d);  // a segment is 16 mm long
  }

  const VolumetricModel active =
      *VolumetricModel::from_vector(m.tables()->layout(), ModelDatum::G1, m.tool_offsets_m(), m.U(),
                                    m.covariance(), *ValidityVolume::hull_of(around));
  ASSERT_TRUE(active.validity().contains(at));
  const auto held = held_out(id.observations, &active, run.options);

  ASSERT_TRUE(held) << held.error().text;
  EXPECT_FALSE(held->active) << *held->active << " against " << *held->candidate_beside_active;
  EXPECT_EQ(held->observations_beside_active, 0u);
  EXPECT_TRUE(judge(id.observations, id.solution, &active, {}, run.options)->accepted);
}

TEST(Judge, NeedsLegsForEveryFold) {
  MadeRun run = make_run({});
  const Identification id = identified(run);
  run.options.held_out_folds = 500;
  EXPECT_EQ(held_out(id.observations, nullptr, run.options).error().code,
            ErrorCode::TooFewObservations);
}

}  // namespace
