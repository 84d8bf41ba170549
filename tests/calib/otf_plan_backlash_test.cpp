// Check and prediction of a path before a run that estimates backlash.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <utility>

#include "abbe/calib/otf/identify/identify.hpp"
#include "abbe/calib/otf/plan/plan.hpp"
#include "abbe/calib/otf/plan/plan_observable.hpp"
#include "otf_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::otf;
using namespace abbe::tests::otf;
using testing::AllOf;
using testing::HasSubstr;

/// Edges and diagonals of X and Y at one height.
std::vector<Vector3> flat_path_m(const MachineNodes& nodes, double z_m) {
  std::vector<Vector3> flat = base_path(nodes).vertices_m;
  for (Vector3& q : flat) {
    q.z() = z_m;
  }
  std::erase_if(flat, [last = Vector3(9, 9, 9)](const Vector3& q) mutable {
    return std::exchange(last, q) == q;
  });
  return flat;
}

/// X beyond 60 mm is driven at two heights: first at Z = 0, before Z has moved, then at -400 mm.
Path path_with_a_late_start_of_Z(const MachineNodes& nodes) {
  Path path{flat_path_m(nodes, 0.0)};
  const std::vector<Vector3> low = flat_path_m(nodes, -0.4);
  path.vertices_m.insert(path.vertices_m.end(), low.begin(), low.end());
  for (Vector3 q : case_a_path().vertices_m) {
    q.x() = 0.6 * q.x() - 0.12;
    path.vertices_m.push_back(q);
  }
  return path;
}

TEST(PlanObservableWithBacklash, APathThatShowsBothDirectionsIsSufficient) {
  for (const auto kind : {TravelDependence::Backlash, TravelDependence::Tables}) {
    EXPECT_TRUE(check_observable(case_a_path(), coarse_machine("[w X' b Y Z (C1) t]"), kind));
  }
}

TEST(PlanObservableWithBacklash, NamesTablesOfLegsThatAreNotUsed) {
  const Machine machine = coarse_machine("[w X' b Y Z (C1) t]");
  const Path path = path_with_a_late_start_of_Z(machine.nodes);
  const auto without = check_observable(path, machine);
  EXPECT_TRUE(without) << without.error().text;
  const auto with = check_observable(path, machine, TravelDependence::Backlash);
  ASSERT_FALSE(with);
  EXPECT_EQ(with.error().code, ErrorCode::RankDeficient);
  EXPECT_THAT(with.error().text, AllOf(HasSubstr("does not determine EXX"), HasSubstr("EBX"),
                                       HasSubstr("; the legs before "),
                                       HasSubstr(" are not used: Z had not moved yet")));
}

/// The same is refused after the run, with the same legs.
TEST(PlanObservableWithBacklash, RefusesWhatTheAdjustmentWouldRefuse) {
  for (const auto& [estimator, kind] :
       {std::pair{Estimator::TwoStep, TravelDependence::Backlash},
        std::pair{Estimator::Simultaneous, TravelDependence::Backlash},
        std::pair{Estimator::TwoStep, TravelDependence::Tables}}) {
    const MadeRunOptions wanted;
    MadeRun run = make_run(wanted);
    run.path = path_with_a_late_start_of_Z(run.machine.nodes);
    measure_run(run, wanted);
    run.options.estimator = estimator;
    run.options.backlash = kind;
    EXPECT_FALSE(check_observable(run.path, run.machine, kind));
    const auto id = identify(run.samples, run.machine, run.path, run.noise, run.options);
    ASSERT_FALSE(id);
    EXPECT_EQ(id.error().code, ErrorCode::RankDeficient) << id.error().text;
    EXPECT_THAT(id.error().text, HasSubstr("; the legs before "));
  }
}

/// X moves forward only. The adjustment accepts it: the differences of X have their prior.
TEST(PlanObservableWithBacklash, AcceptsTablesThatThePathShowsInOneDirectionOnly) {
  const Machine machine = coarse_machine("[w X' b Y Z (C1) t]");
  const std::vector<double>& nodes_m = machine.nodes[0].nodes_m;
  const Vector3 first = case_a_path().vertices_m.front();
  Path path{{{nodes_m.front(), first.y(), first.z()}}};  // X has moved before the first plane
  for (const double node_m : nodes_m) {
    const double x_m = std::max(node_m, nodes_m.front() + 0.05);
    for (const Vector3& q : case_a_path().vertices_m) {
      path.vertices_m.emplace_back(x_m, q.y(), q.z());
    }
  }
  std::erase_if(path.vertices_m, [last = Vector3(9, 9, 9)](const Vector3& q) mutable {
    return (std::exchange(last, q) - q).norm() < 0.03;
  });
  for (const auto kind : {TravelDependence::Backlash, TravelDependence::Tables}) {
    const auto accepted = check_observable(path, machine, kind);
    EXPECT_TRUE(accepted) << accepted.error().text;
  }
}

TEST(PlanObservableWithBacklash, NamesAnAxisThatDoesNotMove) {
  const Machine machine = coarse_machine("[w X' b Y Z (C1) t]");
  const Path flat{flat_path_m(machine.nodes, 0.0)};
  const auto refused = check_observable(flat, machine, TravelDependence::Backlash);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().text, HasSubstr("backlash: the path does not move Z"));
}

/// The uncertainties that the adjustment of a run states, in which noise does not matter.
TEST(PlanPredictionWithBacklash, AgreesWithTheCovarianceOfARun) {
  MadeRun made = make_run({.noise_factor = 0.0, .error_scale_m = 0.1e-6});
  made.options.backlash = TravelDependence::Backlash;
  const auto id = identify(made.samples, made.machine, made.path, made.noise, made.options);
  ASSERT_TRUE(id) << id.error().text;
  PlannedRun run{.machine = made.machine,
                 .tracker_m = made.T_machine_tracker.t_m,
                 .noise = made.noise,
                 .drive = {.feed_m_per_s = 0.4, .acceleration_m_per_s2 = 100.0, .dwell_s = 0.1},
                 .points_per_s = 250.0};
  const auto without = predict(made.path, run);
  run.backlash = TravelDependence::Backlash;
  const auto with = predict(made.path, run);
  ASSERT_TRUE(without && with) << with.error().text;
  EXPECT_EQ(with->rank, without->rank + 14);
  EXPECT_GT(with->rms_u_m, without->rms_u_m);

  ASSERT_EQ(with->backlash.size(), id->solution.backlash.size());
  for (std::size_t i = 0; i < with->backlash.size(); ++i) {
    const Backlash& b = id->solution.backlash[i];
    EXPECT_EQ(with->backlash[i].name, name(b.motion));
    // segments of 10 samples here, of 5 in the prediction: other segments near the ends of the legs
    EXPECT_NEAR(with->backlash[i].max_u, b.u, 0.1 * b.u) << label(b);
  }
}

}  // namespace
