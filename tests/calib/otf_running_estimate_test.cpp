// Tables during a run against the identification of the complete run, and against the truth.
#include <gtest/gtest.h>

#include <cmath>

#include "abbe/calib/model/model_datum.hpp"
#include "abbe/calib/otf/identify/identify.hpp"
#include "abbe/calib/otf/live/running_estimate.hpp"
#include "backlash_run.hpp"
#include "otf_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::otf;
using namespace abbe::tests::otf;

constexpr double kRunningSpeed_m_s = 0.4, kRunningRate_hz = 250.0;
constexpr std::size_t kRunningStand = 25;  // samples at a vertex, see drive()

RunningEstimate estimate_of(const MadeRun& run) {
  return *RunningEstimate::of(
      {.machine = run.machine, .noise = run.noise, .backlash = run.options.backlash});
}

/// The pairs of the first `legs` legs.
void add_pairs(RunningEstimate& estimate, const MadeRun& run, std::size_t legs) {
  const auto& vertices = run.path.vertices_m;
  estimate.add_pair(vertices[0], run.samples[0].p_tracker_m);
  std::size_t at = kRunningStand;
  for (std::size_t leg = 0; leg < legs; ++leg) {
    at += static_cast<std::size_t>(std::ceil((vertices[leg + 1] - vertices[leg]).norm() /
                                             kRunningSpeed_m_s * kRunningRate_hz));
    estimate.add_pair(vertices[leg + 1], run.samples[at].p_tracker_m);
    at += kRunningStand;
  }
}

void add_samples(RunningEstimate& estimate, const MadeRun& run, std::size_t legs) {
  const auto& vertices = run.path.vertices_m;
  std::size_t at = kRunningStand;
  for (std::size_t leg = 0; leg < legs; ++leg) {
    estimate.begin_leg(vertices[leg], vertices[leg + 1]);
    const std::size_t end =
        at + kRunningStand +
        static_cast<std::size_t>(std::ceil((vertices[leg + 1] - vertices[leg]).norm() /
                                           kRunningSpeed_m_s * kRunningRate_hz));
    for (; at < end; ++at) {
      estimate.add(run.samples[at].p_tracker_m);
    }
  }
}

/// Solution after `legs` legs, with the corrections of the pose that are necessary.
Result<TablesSoFar> tables_after(const MadeRun& run, std::size_t legs) {
  RunningEstimate estimate = estimate_of(run);
  add_pairs(estimate, run, legs);
  if (estimate.update_pose()) {
    add_samples(estimate, run, legs);
  }
  auto tables = estimate.tables();
  for (int i = 0; tables && i < 3 && estimate.correct_pose(*tables); ++i) {
    add_samples(estimate, run, legs);
    tables = estimate.tables();
  }
  return tables;
}

std::size_t nodes_determined(const TablesSoFar& tables) {
  std::size_t sum = 0;
  for (const TableSoFar& table : tables.tables) {
    sum += table.determined_nodes();
  }
  return sum;
}

/// The tables of the truth in datum G1, in the order of the layout.
Eigen::VectorXd truth_in_datum(const MadeRun& run) {
  const ParameterLayout layout = layout_of(run.machine);
  Eigen::VectorXd U = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(layout.fit_size()));
  U.head(run.truth.size()) = run.truth;
  return *to_datum(ModelDatum::G1, layout, std::array{run.machine.target_offset_m}, U);
}

/// Largest |value - other| / u over all nodes with u > 0 that the datum does not fix.
double largest_in_u(const TablesSoFar& tables, const ParameterLayout& layout,
                    const Eigen::VectorXd& other) {
  constexpr double kFixedByDatum = 1e-8;  // its u is 1e-9
  double largest = 0.0;
  for (std::size_t t = 0; t < tables.tables.size(); ++t) {
    const auto& nodes = tables.tables[t].nodes;
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      const double true_value = other(static_cast<Eigen::Index>(layout.tables()[t].offset + i));
      const double difference = std::abs(nodes[i].value - true_value);
      largest = std::max(largest, difference / std::max(nodes[i].u, kFixedByDatum));
    }
  }
  return largest;
}

TEST(RunningEstimate, OfTheCompleteRunAgreesWithTruthAndIdentification) {
  MadeRun run = make_run({});
  run.noise.u_range_offset_m = 6e-6;
  const auto tables = tables_after(run, run.path.vertices_m.size() - 1);
  ASSERT_TRUE(tables) << tables.error().text;
  const ParameterLayout layout = layout_of(run.machine);
  for (const TableSoFar& table : tables->tables) {
    EXPECT_TRUE(table.determined()) << name(table.motion);
  }
  ASSERT_TRUE(tables->rigid);
  EXPECT_LT(tables->variance_factor, 2.0);

  // About 50 values: 4.5 u is exceeded by chance in less than one run of 1000.
  EXPECT_LT(largest_in_u(*tables, layout, truth_in_datum(run)), 4.5);

  // The identification uses means of 10 samples and other samples near the corners.
  const auto identified = identify(run.samples, run.machine, run.path, run.noise, run.options);
  ASSERT_TRUE(identified) << identified.error().text;
  const auto parameters = identified->solution.model.parameters();
  Eigen::VectorXd U(static_cast<Eigen::Index>(parameters.size()));
  for (Eigen::Index i = 0; i < U.size(); ++i) {
    U(i) = parameters[static_cast<std::size_t>(i)].value;
  }
  EXPECT_LT(largest_in_u(*tables, layout, U), 2.0);
}

/// Backlash of 8 um or urad in all tables: the mean of both directions is right within the noise,
/// and half the difference is in the uncertainty.
TEST(RunningEstimate, WithBacklashIsTheMeanOfBothDirections) {
  const MadeRunOptions wanted{.speed_m_s = kRunningSpeed_m_s, .rate_hz = kRunningRate_hz};
  MadeRun run = make_backlash_run(wanted, {Eigen::VectorXd::Constant(14, 8e-6)});
  run.options.backlash = TravelDependence::Backlash;
  const std::size_t legs = run.path.vertices_m.size() - 1;
  const auto with = tables_after(run, legs);
  run.options.backlash = TravelDependence::None;
  const auto without = tables_after(run, legs);
  ASSERT_TRUE(with && without) << with.error().text;

  const Eigen::VectorXd truth = truth_in_datum(run);
  const ParameterLayout layout = layout_of(run.machine);
  double error = 0.0, error_without = 0.0;
  for (std::size_t t = 0; t < with->tables.size(); ++t) {
    for (std::size_t i = 0; i < with->tables[t].nodes.size(); ++i) {
      const NodeSoFar& node = with->tables[t].nodes[i];
      const double value = truth(static_cast<Eigen::Index>(layout.tables()[t].offset + i));
      EXPECT_TRUE(node.determined);
      EXPECT_NEAR(node.u, 4e-6, 1.5e-6);
      error = std::max(error, std::abs(node.value - value));
      error_without = std::max(error_without, std::abs(without->tables[t].nodes[i].value - value));
    }
  }
  EXPECT_LT(error, 0.5 * error_without);
}

TEST(RunningEstimate, OfOneLegDeterminesNothing) {
  const auto tables = tables_after(make_run({}), 1);
  ASSERT_FALSE(tables);
  EXPECT_EQ(tables.error().code, ErrorCode::TooFewObservations);
}

TEST(RunningEstimate, OfAFewLegsDeterminesNoTableWithoutEvidence) {
  const MadeRun run = make_run({});
  std::size_t before = 0;
  const std::size_t legs = run.path.vertices_m.size() - 1;
  for (const std::size_t driven : {std::size_t{3}, legs / 4, legs / 2, legs}) {
    const auto tables = tables_after(run, driven);
    ASSERT_TRUE(tables) << tables.error().text;
    const std::size_t determined = nodes_determined(*tables);
    EXPECT_GE(determined, before) << driven;
    before = determined;

    const ParameterLayout layout = layout_of(run.machine);
    const Eigen::VectorXd truth = truth_in_datum(run);
    for (std::size_t t = 0; t < tables->tables.size(); ++t) {
      for (std::size_t i = 0; i < tables->tables[t].nodes.size(); ++i) {
        const NodeSoFar& node = tables->tables[t].nodes[i];
        const double value = truth(static_cast<Eigen::Index>(layout.tables()[t].offset + i));
        if (node.determined) {
          EXPECT_LT(std::abs(node.value - value), 4.5 * node.u + 1e-8)
              << name(tables->tables[t].motion) << " node " << i << " after " << driven << " legs";
        }
      }
    }
  }
}

/// Errors of 0.5 mm turn the pose of the pairs by 1e-3: 0.5 um of second order.
TEST(RunningEstimate, CorrectsThePoseOfALargeMachineError) {
  const MadeRun run = make_run({.error_scale_m = 300e-6});
  RunningEstimate estimate = estimate_of(run);
  const std::size_t legs = run.path.vertices_m.size() - 1;
  add_pairs(estimate, run, legs);
  ASSERT_TRUE(estimate.update_pose());
  EXPECT_FALSE(estimate.update_pose());
  add_samples(estimate, run, legs);

  const auto tables = estimate.tables();
  ASSERT_TRUE(tables) << tables.error().text;
  EXPECT_TRUE(estimate.correct_pose(*tables));
  add_samples(estimate, run, legs);
  const auto corrected = estimate.tables();
  ASSERT_TRUE(corrected) << corrected.error().text;
  EXPECT_FALSE(estimate.correct_pose(*corrected));
}

}  // namespace
