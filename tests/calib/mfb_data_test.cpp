#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <optional>
#include <random>

#include "abbe/calib/mfb/plan/plan_prediction.hpp"
#include "mfb_simulation.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::mfb;
using namespace abbe::tests::mfb;
using testing::HasSubstr;
using testing::StartsWith;

Bar bar_of_pattern() {
  std::vector<Vector3> O_m;
  const TouchPattern pattern = paper_pattern();
  for (std::size_t i = 0; i < pattern.holes(); ++i) {
    O_m.emplace_back(pattern.hole_x_m[i], pattern.hole_y_m[i], 0.0);
  }
  return bar_with(O_m);
}

/// Supports and section of mfb-files.md.
Sag paper_sag() {
  return {{-15e-3, 565e-3}, {114.45e-3, 435.55e-3}, {36e-3, 36e-3}, 8100.0, 145e9};
}

TEST(MfbBar, PlacesOfTouchesAreThoseOfTheReference) {
  const TouchPattern pattern = paper_pattern();
  const auto touches = nominal_touches(pattern, 0.0);
  ASSERT_EQ(touches.size(), 316u);
  EXPECT_EQ(pattern.count(), 316u);
  const BarTouches expected = nominal_touches();
  std::vector<Vector3> points_m;
  for (const auto& touch : touches) {
    points_m.push_back(touch.tip_m);
  }
  const BarTouches found = by_feature(touches, points_m);
  const auto near = [](const std::vector<Vector3>& a, const std::vector<Vector3>& b) {
    ASSERT_EQ(a.size(), b.size());
    for (std::size_t k = 0; k < a.size(); ++k) {
      EXPECT_LT((a[k] - b[k]).norm(), 0.05e-3);  // form and place of the reference's features
    }
  };
  for (std::size_t i = 0; i < 12; ++i) {
    near(found.holes_m[i], expected.holes_m[i]);
  }
  for (std::size_t j = 0; j < 11; ++j) {
    near(found.rods_m[j], expected.rods_m[j]);
    near(found.planes_m[j][0], expected.planes_m[j][0]);
    near(found.planes_m[j][1], expected.planes_m[j][1]);
  }
}

TEST(MfbBar, NormalsAreThoseOfTheExtraction) {
  const auto touches = nominal_touches(paper_pattern(), 1.5e-3);
  std::vector<Vector3> tips_m;
  for (const auto& touch : touches) {
    tips_m.push_back(touch.tip_m);
  }
  const auto points = points_of_interest(by_feature(touches, tips_m), Matrix3::Identity());
  ASSERT_TRUE(points) << points.error().text;
  for (std::size_t k = 0; k < touches.size(); ++k) {
    EXPECT_LT((points->normals[k] - touches[k].outward).norm(), 1e-12) << name(touches[k].target);
  }
}

TEST(MfbBar, EveryTouchHasItsPlace) {
  const TouchPattern pattern = paper_pattern();
  const auto touches = nominal_touches(pattern, 0.0);
  for (std::size_t k = 0; k < touches.size(); ++k) {
    EXPECT_EQ(pattern.place_of(touches[k].target), k);
  }
  EXPECT_FALSE(pattern.place_of({Feature::Hole, 12, Side::Left, 0}));
  EXPECT_FALSE(pattern.place_of({Feature::Rod, 11, Side::Left, 0}));
  EXPECT_FALSE(pattern.place_of({Feature::Hole, 0, Side::Left, 8}));
  EXPECT_FALSE(pattern.place_of({Feature::Rod, 0, Side::Right, 0}));
  EXPECT_EQ(name(Target{Feature::Plane, 4, Side::Right, 2}), "plane 5 R, k = 2");
}

TEST(MfbBar, SagsByThePapersAmount) {
  const Vector3 down(0.0, 0.0, -1.0);
  // mfb-files.md: the ends and the middle move by 0.155 um; gravity along x has no effect.
  for (const double x_m : {-15e-3, 275e-3, 565e-3}) {
    EXPECT_NEAR(-sag_m(paper_sag(), x_m, down).z(), 0.155e-6, 0.002e-6) << x_m;
  }
  EXPECT_NEAR(sag_m(paper_sag(), 114.45e-3, down).z(), 0.0, 1e-12);
  EXPECT_EQ(sag_m(paper_sag(), 0.2, Vector3::UnitX()).norm(), 0.0);
  const double diagonal = std::sqrt(0.5);
  EXPECT_NEAR(sag_m(paper_sag(), 0.275, diagonal * down).z(),
              diagonal * sag_m(paper_sag(), 0.275, down).z(), 1e-15);
}

TEST(MfbBar, ImpossibleDataAreRefused) {
  EXPECT_TRUE(check(bar_of_pattern()));
  const auto refusal = [](const std::function<void(Bar&)>& change) {
    Bar bar = bar_of_pattern();
    change(bar);
    const auto valid = check(bar);
    return valid ? std::string() : valid.error().text;
  };
  EXPECT_THAT(refusal([](Bar& b) { b.pattern.rod_x_m[3] = 0.21; }), HasSubstr("rod 4 is at x"));
  EXPECT_THAT(refusal([](Bar& b) { b.pattern.hole_levels_m = {0.0}; }), HasSubstr("touches"));
  EXPECT_THAT(refusal([](Bar& b) { b.O_m[2].x() += 2e-3; }), HasSubstr("hole 3"));
  EXPECT_THAT(refusal([](Bar& b) { b.O_m[11].z() = 1e-6; }), HasSubstr("define the axes"));
  EXPECT_THAT(refusal([](Bar& b) { b.O_m.pop_back(); }), HasSubstr("11 calibrated points"));
  EXPECT_THAT(refusal([](Bar& b) { b.covariance_m2(4, 4) = -1e-12; }), HasSubstr("eigenvalue"));
  EXPECT_THAT(refusal([](Bar& b) { b.covariance_m2(4, 5) = 1e-13; }), HasSubstr("symmetric"));
  EXPECT_THAT(refusal([](Bar& b) { b.covariance_m2.resize(3, 3); }), HasSubstr("36 x 36"));
  EXPECT_THAT(refusal([](Bar& b) { b.pattern.hole_radius_m = 0.0; }), HasSubstr("radius"));
  EXPECT_THAT(
      refusal([](Bar& b) { b.pattern.hole_x_m[1] = std::numeric_limits<double>::quiet_NaN(); }),
      HasSubstr("not a number"));
  EXPECT_THAT(refusal([](Bar& b) {
                b.sag = paper_sag();
                b.sag->supports_m[1] = 0.7;
              }),
              HasSubstr("supports"));
}

TEST(MfbPlan, ImpossibleMeasurementsAreRefused) {
  const Bar bar = bar_of_pattern();
  EXPECT_TRUE(check(paper_plan(), bar));
  const auto refusal = [&](const std::function<void(Plan&)>& change, const Bar& of) {
    Plan plan = paper_plan();
    change(plan);
    const auto valid = check(plan, of);
    return valid ? std::string() : valid.error().text;
  };
  EXPECT_THAT(refusal([](Plan& p) { p.measurements[3].name = "X1"; }, bar),
              StartsWith("X1: the name occurs twice"));
  EXPECT_THAT(refusal([](Plan& p) { p.measurements[6].origin_m.x() += 1e-3; }, bar),
              StartsWith("Y3-: position P6 has another pose"));
  EXPECT_THAT(refusal([](Plan& p) { p.measurements[0].bar_z = Vector3(0.1, 0, 1); }, bar),
              HasSubstr("perpendicular"));
  EXPECT_THAT(refusal([](Plan& p) { p.noise = {}; }, bar), HasSubstr("noise"));
  EXPECT_THAT(refusal([](Plan& p) { p.tip_radius_m = 9e-3; }, bar), HasSubstr("does not fit"));
  EXPECT_THAT(refusal([](Plan& p) { p.measurements.clear(); }, bar), HasSubstr("no measurement"));
  Bar steel = bar;
  steel.expansion = Expansivity{1e-6, 0.05e-6};
  EXPECT_THAT(refusal([](Plan&) {}, steel), StartsWith("X1: the temperature"));
}

TEST(MfbPlan, PairsAreOfOnePositionAndTool) {
  const Plan plan = with_pairs(paper_plan());
  const auto pairs = pairs_of(plan.measurements);
  for (std::size_t m = 0; m < pairs.size(); ++m) {
    EXPECT_EQ(pairs[m].has_value(), m % 2 == 1);
    if (pairs[m]) {
      EXPECT_EQ(*pairs[m], m - 1);
    }
  }
}

/// A simulated bar of its own temperature, or that sags.
double chi2_per_dof(const ProbingOptions& options, const std::function<void(Bar&, Plan&)>& change) {
  std::mt19937_64 random(61);
  const SimulatedMachine machine(random);
  Plan plan = paper_plan();
  ProbedBar probed = probe(machine, plan, random, options);
  for (Measurement& m : plan.measurements) {
    m.temperature_K = kReferenceTemperature_K + options.warmer_K;
  }
  change(probed.bar, plan);
  Options wide;
  wide.solve.most_u_m = 50e-6;  // alpha is not known well
  const auto found = identify(probed.bar, plan, probed.touches, paper_machine(), wide);
  EXPECT_TRUE(found) << found.error().text;
  if (!found) {
    return 0.0;
  }
  const Eigen::VectorXd off = found->solution.U - machine.truth(found->observations.basis.layout());
  const Eigen::VectorXd u = found->solution.covariance.diagonal().cwiseMax(1e-30).cwiseSqrt();
  EXPECT_LT(off.cwiseQuotient(u).cwiseAbs().maxCoeff(), 5.0);
  return found->solution.statistics.chi2_per_dof;
}

TEST(MfbIdentify, CorrectsTheExpansionOfTheBar) {
  ProbingOptions steel{.expansion = Expansivity{11e-6, 0.5e-6}, .warmer_K = 3.0};
  EXPECT_NEAR(chi2_per_dof(steel, [](Bar&, Plan&) {}), 1.0, 0.25);
  steel.alpha_error_per_K = 0.7e-6;  // 1.4 u: covered by the uncertainty of alpha
  EXPECT_NEAR(chi2_per_dof(steel, [](Bar&, Plan& p) { p.noise.u_temperature_K = 0.05; }), 1.0,
              0.25);
}

/// Standard uncertainty of EXX at the last node, whose reference is at the first one.
double u_of_travel_m(double u_K, std::optional<double> u_common_K) {
  std::mt19937_64 random(62);
  const SimulatedMachine machine(random);
  Plan plan = paper_plan();
  const ProbedBar probed =
      probe(machine, plan, random, {.expansion = Expansivity{11e-6, 0.0}, .warmer_K = 1.0});
  for (Measurement& m : plan.measurements) {
    m.temperature_K = kReferenceTemperature_K + 1.0;
  }
  plan.noise.u_temperature_K = u_K;
  plan.noise.u_common_temperature_K = u_common_K;
  Options wide;
  wide.solve.most_u_m = 50e-6;
  const auto found = identify(probed.bar, plan, probed.touches, paper_machine(), wide);
  EXPECT_TRUE(found) << found.error().text;
  const ParameterLayout& layout = found->observations.basis.layout();
  const auto table = *layout.find({Motion::X, Axis::X});
  const auto at = static_cast<Eigen::Index>(table.offset);
  const auto last = at + static_cast<Eigen::Index>(layout.node_count(Axis::X)) - 1;
  const Eigen::MatrixXd& C = found->solution.covariance;
  return std::sqrt(C(at, at) + C(last, last) - 2.0 * C(at, last));
}

/// A thermometer that is wrong is wrong at every position: more positions do not help.
TEST(MfbIdentify, TheErrorOfTheThermometerIsCommonToAllPositions) {
  const std::vector<double> nodes_m = paper_machine().nodes[0].nodes_m;
  const double common_m = 11e-6 * 0.3 * (nodes_m.back() - nodes_m.front());
  EXPECT_GT(u_of_travel_m(0.3, std::nullopt), common_m);
  EXPECT_NEAR(u_of_travel_m(0.0, 0.3), common_m, 0.3 * common_m);
  EXPECT_LT(u_of_travel_m(0.3, 0.0), 0.9 * u_of_travel_m(0.3, std::nullopt));
}

TEST(MfbIdentify, CorrectsTheSagOfTheBar) {
  Sag soft = paper_sag();
  soft.youngs_modulus_Pa = 5e9;  // 4.5 um
  const ProbingOptions options{.sag = soft};
  EXPECT_NEAR(chi2_per_dof(options, [](Bar&, Plan&) {}), 1.0, 0.25);
}

TEST(MfbPrediction, OfAnotherOrderOfTheAxesNeedsAnotherPlan) {
  MfbMachine other = paper_machine();
  other.chain = *KinematicChain::parse("[w Y' b X Z t]");
  const auto of_paper = predict(bar_of_pattern(), paper_plan(), other);
  ASSERT_TRUE(of_paper) << of_paper.error().text;
  EXPECT_THAT(of_paper->not_seen, testing::IsSupersetOf({"ECX", "ECY"}));

  Plan swapped = paper_plan();
  for (Measurement& m : swapped.measurements) {
    for (Vector3* v : {&m.origin_m, &m.bar_x, &m.bar_z, &m.tool_offset_m}) {
      std::swap(v->x(), v->y());
    }
  }
  const auto found = predict(bar_of_pattern(), swapped, other);
  ASSERT_TRUE(found) << found.error().text;
  EXPECT_THAT(found->not_seen, testing::IsEmpty());
}

}  // namespace
