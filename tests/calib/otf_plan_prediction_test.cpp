/// Prediction of a run, against the figures of the prototype (ref.json) and against a run.
#include "abbe/calib/otf/plan/plan_prediction.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "abbe/calib/otf/identify/identify.hpp"
#include "abbe/calib/otf/plan/plan.hpp"
#include "abbe/calib/otf/plan/plan_observable.hpp"
#include "otf_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::otf;
using namespace abbe::tests::otf;
using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

/// Case A of the prototype: 2500 mm/min, 500 points per second, tracker at 1 m.
PlannedRun case_a_run() {
  return {.machine = case_a_machine(), .tracker_m = {-0.75, -0.62, -0.35}};
}

PlannedRun coarse_run() {
  PlannedRun run = case_a_run();
  run.machine = coarse_machine("[w X' b Y Z (C1) t]");
  return run;
}

TEST(PlanPrediction, IsTheBoundOfThePrototype) {
  const auto p = predict(case_a_path(), case_a_run());
  ASSERT_TRUE(p) << p.error().text;
  // ref.json, cases.A.crb_rms_rigidfree_um; segments begin at other samples there: 0.5 %
  EXPECT_NEAR(p->rms_u_m, 0.079285e-6, 0.005 * 0.079285e-6);
  EXPECT_EQ(p->rank, 149u);
  EXPECT_EQ(p->unknowns, 169u);
  EXPECT_EQ(p->datum_defect, 20u);
  EXPECT_NEAR(p->length_m, 40.418, 1e-3);
  EXPECT_THAT(p->left_out, ElementsAre("ECY", "EAZ", "EBZ", "ECZ"));
}

TEST(PlanPrediction, OfThePathOfEdgesAndDiagonalsIsEightTimesLarger) {
  const auto p = predict(base_path(case_a_machine().nodes), case_a_run(), 1);
  ASSERT_TRUE(p) << p.error().text;
  EXPECT_NEAR(p->rms_u_m, 0.667e-6, 0.005 * 0.667e-6);  // figure of the prototype
}

TEST(PlanPrediction, BasePathIsThatOfThePrototype) {
  const Path base = base_path(case_a_machine().nodes);
  const auto rows = read_rows(small_file("path_base.csv"));
  ASSERT_EQ(base.vertices_m.size(), rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      EXPECT_NEAR(base.vertices_m[i][static_cast<Eigen::Index>(k)], rows[i].values[k], 1e-12) << i;
    }
  }
}

/// The uncertainties that the adjustment of a run states, in which noise does not matter.
void expect_covariance_of_a_run(double u_range_offset_m) {
  MadeRun made = make_run({.noise_factor = 0.0, .error_scale_m = 0.1e-6});
  made.noise.u_range_offset_m = u_range_offset_m;
  const auto solution = identify(made.samples, made.machine, made.path, made.noise, made.options);
  ASSERT_TRUE(solution) << solution.error().text;
  PlannedRun run{.machine = made.machine,
                 .tracker_m = made.T_machine_tracker.t_m,
                 .noise = made.noise,
                 .drive = {.feed_m_per_s = 0.4, .acceleration_m_per_s2 = 100.0, .dwell_s = 0.1},
                 .points_per_s = 250.0};
  const auto p = predict(made.path, run);
  ASSERT_TRUE(p) << p.error().text;

  const auto parameters = solution->solution.model.parameters();
  for (const TableUncertainty& table : p->tables) {
    double most = 0.0;
    for (const Parameter& parameter : parameters) {
      most = parameter.name == table.name ? std::max(most, parameter.u) : most;
    }
    // segments of 10 samples here, of 5 in the prediction: other segments near the ends of the legs
    EXPECT_NEAR(table.max_u, most, 0.1 * most) << table.name;
  }
}

TEST(PlanPrediction, AgreesWithTheCovarianceOfARun) {
  expect_covariance_of_a_run(0.0);
}

TEST(PlanPrediction, AgreesWithTheCovarianceOfARunWhoseRangesMayHaveAnOffset) {
  expect_covariance_of_a_run(50e-6);
}

TEST(PlanPrediction, IsLargerWithAnOffsetOfTheRanges) {
  PlannedRun run = coarse_run();
  const auto without = predict(case_a_path(), run);
  run.noise.u_range_offset_m = 50e-6;
  const auto with = predict(case_a_path(), run);
  ASSERT_TRUE(without && with);
  EXPECT_GT(with->rms_u_m, without->rms_u_m);
  EXPECT_GT(with->max_u_m, without->max_u_m);
}

TEST(PlanPrediction, MapStatesTheUncertaintyOfEveryPlace) {
  const auto p = predict(case_a_path(), coarse_run());
  ASSERT_TRUE(p) << p.error().text;
  ASSERT_EQ(p->map.size(), 125u);
  double most = 0.0;
  for (const PlaceUncertainty& place : p->map) {
    EXPECT_GT(place.u_m, 0.2 * p->rms_u_m);
    most = std::max(most, place.u_m);
  }
  EXPECT_EQ(p->max_u_m, most);
}

TEST(PlanPrediction, IsInverseToTheRootOfThePointRate) {
  PlannedRun run = coarse_run();
  const auto fast = predict(case_a_path(), run);
  run.points_per_s = 125.0;
  const auto slow = predict(case_a_path(), run);
  ASSERT_TRUE(fast && slow);
  EXPECT_NEAR(slow->rms_u_m / fast->rms_u_m, 2.0, 0.02);
}

TEST(PlanDuration, IsThatOfTrapezesAndDwells) {
  const Drive drive{.feed_m_per_s = 0.1, .acceleration_m_per_s2 = 1.0, .dwell_s = 0.5};
  EXPECT_NEAR(leg_duration_s(1.0, drive), 10.1, 1e-12);    // 1 m at 0.1 m/s, ramps 0.1 s
  EXPECT_NEAR(leg_duration_s(0.0025, drive), 0.1, 1e-12);  // never at its feed: 2 sqrt(L/a)
  EXPECT_NEAR(duration_s({{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}}}, drive), 21.2, 1e-12);
}

struct BadRun {
  PlannedRun run;
  const char* what;
};

TEST(PlanInput, IsRefusedWithTheReason) {
  std::vector<BadRun> bad(6, {coarse_run(), ""});
  bad[0].run.tracker_m = {0.0, 0.0, -0.2};
  bad[0].what = "inside the volume";
  bad[1].run.tracker_m = {-0.3, -0.28, -0.3};
  bad[1].what = "mm from the volume";
  bad[2].run.machine.nodes[1].nodes_m = {0.0};
  bad[2].what = "axis Y";
  bad[3].run.machine.nodes[2].nodes_m = {0.0, 0.015};
  bad[3].what = "axis Z travels 15 mm";
  bad[4].run.drive.feed_m_per_s = 0.0;
  bad[4].what = "feed 0 mm/min";
  bad[5].run.noise.sigma_angle_rad = std::nan("");
  bad[5].what = "sigma_angle";
  for (const BadRun& b : bad) {
    const auto refused = check(b.run);
    ASSERT_FALSE(refused) << b.what;
    EXPECT_EQ(refused.error().code, ErrorCode::BadInput);
    EXPECT_THAT(refused.error().text, HasSubstr(b.what));
  }
}

TEST(PlanObservable, APathOfThePrototypeDeterminesAllTables) {
  EXPECT_TRUE(check_observable(case_a_path(), case_a_machine()));
  EXPECT_TRUE(check_observable(base_path(case_a_machine().nodes), case_a_machine()));
}

TEST(PlanObservable, NamesTheTablesThatAPathDoesNotDetermine) {
  // All legs at Z = 0: X and Y alone, at one height.
  Path flat = base_path(case_a_machine().nodes);
  for (Vector3& q : flat.vertices_m) {
    q.z() = 0.0;
  }
  std::erase_if(flat.vertices_m, [last = Vector3(9, 9, 9)](const Vector3& q) mutable {
    return std::exchange(last, q) == q;
  });
  const auto refused = check_observable(flat, case_a_machine());
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::RankDeficient);
  EXPECT_THAT(refused.error().text, AllOf(HasSubstr("EXZ, EYZ, EZZ"), HasSubstr("EA0Z, EB0Z"),
                                          HasSubstr("Z -400 to 0 mm is not reached")));
}

/// Without legs beyond X = 150 mm only tables of X are missing, and squareness with them: the line
/// through the ends of EYX and EZX is unknown. No datum combination is named.
TEST(PlanObservable, NamesOnlyTablesOfAnAxisThatIsDrivenInPart) {
  Path part = case_a_path();
  for (Vector3& q : part.vertices_m) {
    q.x() = 0.5 * q.x() - 0.15;
  }
  const auto seen = observability(part, case_a_machine());
  ASSERT_TRUE(seen) << seen.error().text;
  EXPECT_LT(seen->rank, seen->needed);
  EXPECT_THAT(seen->undetermined,
              AllOf(Contains("EXX"), Contains("EYX"), Not(Contains("EXY")), Not(Contains("EAY")),
                    Not(Contains("EZZ")), Not(Contains("EA0Z"))));
}

/// What is refused before the run is what the adjustment refuses after it.
TEST(PlanObservable, RefusesWhatTheAdjustmentWouldRefuse) {
  MadeRun made = make_run({});
  made.path.vertices_m.resize(4);
  EXPECT_FALSE(check_observable(made.path, made.machine));
  std::vector<TrackerObservation> samples;
  for (const Vector3& q : drive(made.path, 0.4, 250.0)) {
    const Vector3 p = q + made.machine.target_offset_m - made.T_machine_tracker.t_m;
    samples.push_back({static_cast<double>(samples.size()) / 250.0,
                       made.T_machine_tracker.R.transpose() * p, true});
  }
  const auto refused = identify(samples, made.machine, made.path, made.noise, made.options);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::RankDeficient) << refused.error().text;
}

}  // namespace
