/// The true bar, its targets, its sag and the plans.

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>

#include "abbe/sim/mfb/plan.hpp"
#include "abbe/sim/mfb/true_bar.hpp"

namespace abbe::sim::mfb {
namespace {

using Eigen::Vector3d;
using nlohmann::json;

json mfb_reference(const std::string& name) {
  std::ifstream in(std::string(ABBE_TEST_DATA) + "/mfb/" + name);
  return json::parse(in);
}

Vector3d vector_mm(const json& v) {
  return 1e-3 * Vector3d(v.at(0).get<double>(), v.at(1).get<double>(), v.at(2).get<double>());
}

const json& points_of(const json& points, const Feature& f) {
  if (f.kind == Kind::Hole) return points.at("holes").at(f.index);
  if (f.kind == Kind::Rod) return points.at("rods").at(f.index);
  return points.at("planes").at(f.index).at(f.side == Side::Left ? 0 : 1);
}

TEST(MfbTargets, AreThoseOfTheReference) {
  constexpr double kBesideNominal_m = 0.05e-3;  // the deviations of the bar of the reference
  const json points = mfb_reference("nominal_points.json");
  const auto all = targets(reference_pattern());
  EXPECT_EQ(all.size(), 316u);
  for (const Target& t : all) {
    const Vector3d expected_m = vector_mm(points_of(points, t.feature).at(t.k));
    EXPECT_LT((t.place_m - expected_m).norm(), kBesideNominal_m) << name(t);
    EXPECT_DOUBLE_EQ(t.normal.norm(), 1.0);
  }
}

TEST(MfbTargets, HaveNamesAsInPointsCsv) {
  const auto all = targets(reference_pattern());
  std::set<std::string> names;
  for (const Target& t : all) names.insert(name(t));
  EXPECT_EQ(names.size(), all.size());
  for (const char* expected : {"hole,1,,0", "hole,12,,7", "rod,11,,11", "plane,1,L,0"})
    EXPECT_TRUE(names.contains(expected)) << expected;
}

TEST(MfbTargets, FromBelowAreMirrored) {
  const auto above = targets(reference_pattern()),
             below = targets(reference_pattern(), Probed::FromBelow);
  const Vector3d mirror(1, 1, -1);
  for (std::size_t i = 0; i < above.size(); ++i) {
    EXPECT_EQ(above[i].place_m.cwiseProduct(mirror), below[i].place_m);
    EXPECT_EQ(above[i].normal.cwiseProduct(mirror), below[i].normal);
  }
}

TEST(MfbTrueBar, DefinesItsOwnFrame) {
  const TrueBar bar = random_bar(reference_pattern(), {.seed = 4});
  const auto O_m = points_of_interest_m(bar);
  constexpr double kRounding_m = 1e-15;
  EXPECT_LT(O_m.front().norm(), kRounding_m);
  EXPECT_LT(O_m.back().tail<2>().norm(), kRounding_m);
  EXPECT_LT((bar.holes[0].point_m -
             bar.holes[0].direction * bar.holes[0].point_m.z() / bar.holes[0].direction.z())
                .norm(),
            kRounding_m);

  double largest_m = 0.0;
  for (std::size_t i = 0; i < O_m.size(); ++i) {
    const Vector3d nominal_m(bar.pattern.hole_x_m[i], bar.pattern.hole_y_m[i], 0.0);
    largest_m = std::max(largest_m, (O_m[i] - nominal_m).norm());
  }
  EXPECT_GT(largest_m, 1e-6);
  EXPECT_LT(largest_m, 200e-6);
}

TEST(MfbTrueBar, IsTouchedOnItsSurfaces) {
  constexpr double kTip_m = 1.5e-3;
  TrueBar bar = random_bar(reference_pattern(), {.seed = 5});
  bar.form_m.assign(bar.form_m.size(), 0.0);
  const auto all = targets(bar.pattern);
  for (std::size_t n = 0; n < all.size(); ++n) {
    const Contact c = contact(bar, all[n], n, kTip_m);
    EXPECT_NEAR((c.centre_m - c.surface_m).norm(), kTip_m, 1e-15);
    const Feature& f = all[n].feature;
    if (f.kind == Kind::Plane) {
      const TruePlane& p = bar.planes[f.index][static_cast<std::size_t>(f.side)];
      EXPECT_NEAR(p.normal.dot(c.surface_m - p.point_m), 0.0, 1e-15);
    } else {
      const TrueCylinder& cylinder = (f.kind == Kind::Hole ? bar.holes : bar.rods)[f.index];
      const double distance_m = (c.surface_m - cylinder.point_m).cross(cylinder.direction).norm();
      EXPECT_NEAR(distance_m, cylinder.radius_m, 1e-15) << name(all[n]);
    }
  }
}

TEST(MfbTrueBar, HasFormErrorsThatFitsDoNotSee) {
  const TrueBar bar = random_bar(reference_pattern(), {.form_m = 1e-6, .seed = 6});
  const auto all = targets(bar.pattern);
  double squares = 0.0;
  Vector3d moves = Vector3d::Zero();
  double inflates = 0.0;
  for (std::size_t n = 0; n < 8; ++n) {  // hole 1
    squares += bar.form_m[n] * bar.form_m[n];
    moves += bar.form_m[n] * all[n].normal;
    inflates += bar.form_m[n];
  }
  EXPECT_GT(std::sqrt(squares / 8.0), 1e-7);
  EXPECT_LT(moves.norm(), 1e-18);
  EXPECT_LT(std::abs(inflates), 1e-18);
}

TEST(MfbSag, OfThePaperIs0p16Micrometres) {
  const Sag sag = reference_sag(reference_pattern());
  EXPECT_NEAR(sag.supports_m[1] - sag.supports_m[0], 321.1e-3, 0.1e-3);
  const double height_m = sag.section_yz_m[1];
  EXPECT_EQ(sag_m(sag, height_m, sag.supports_m[0]), 0.0);
  for (const double x_m : {-0.015, 0.275, 0.565})
    EXPECT_NEAR(sag_m(sag, height_m, x_m), 0.155e-6, 0.005e-6) << x_m;
}

TEST(MfbPlan, HasTheMeasurementsOfThePaper) {
  const auto count = [](PlanKind kind, Passes passes) {
    std::set<std::string> names, positions;
    for (const Measurement& m : reference_plan(kind, passes, 0.55)) {
      names.insert(m.name);
      positions.insert(m.position);
    }
    return std::pair(names.size(), positions.size());
  };
  EXPECT_EQ(count(PlanKind::Full, Passes::ForwardAlone),
            std::pair(std::size_t{17}, std::size_t{14}));
  EXPECT_EQ(count(PlanKind::Full, Passes::Pairs), std::pair(std::size_t{34}, std::size_t{14}));
  EXPECT_EQ(count(PlanKind::Fewest, Passes::ForwardAlone).first, 12u);
}

TEST(MfbPlan, StaysInTheCube) {
  for (const double length_m : {0.55, 0.3}) {
    for (const auto kind : {PlanKind::Full, PlanKind::FullRolled}) {
      for (const Measurement& m : reference_plan(kind, Passes::ForwardAlone, length_m)) {
        EXPECT_NEAR(m.bar_x.dot(m.bar_z), 0.0, 1e-15) << m.name;
        if (length_m != 0.55) continue;  // tools are not in proportion to the bar
        for (const double along_m : {0.0, length_m}) {
          const Vector3d q_m = m.origin_m + along_m * m.bar_x - m.tool_offset_m;
          EXPECT_GE(q_m.minCoeff(), -1e-12) << m.name;
          EXPECT_LE(q_m.maxCoeff(), length_m + 1e-12) << m.name;
        }
      }
    }
  }
}

}  // namespace
}  // namespace abbe::sim::mfb
