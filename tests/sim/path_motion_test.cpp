#include "abbe/sim/path_motion.hpp"

#include <gmock/gmock.h>

namespace abbe::sim {
namespace {

PathMotion l_shaped() {
  PathPlan plan;
  plan.vertices = {{{0, 0, 0}}, {{0.5, 0, 0}}, {{0.5, -0.3, 0}}, {{0.5, -0.3 + 1e-4, 0}}};
  plan.feed_m_per_s = 0.1;
  plan.acceleration_m_per_s2 = 1.0;
  plan.dwell_s = 0.05;
  return PathMotion::plan(plan).value();
}

TEST(PathMotion, StandsBeforeItsStartAndAfterItsEnd) {
  const PathMotion motion = l_shaped();
  EXPECT_EQ(motion.at(-10.0).q_m, Eigen::Vector3d(0, 0, 0));
  EXPECT_EQ(motion.at(0.049).q_m, Eigen::Vector3d(0, 0, 0));
  EXPECT_EQ(motion.at(motion.duration_s() + 1.0).velocity_m_per_s, Eigen::Vector3d(0, 0, 0));
  EXPECT_LT((motion.at(motion.duration_s()).q_m - Eigen::Vector3d(0.5, -0.2999, 0)).norm(), 1e-15);
}

TEST(PathMotion, StopsAtEveryVertexAndDwellsThere) {
  const PathMotion motion = l_shaped();
  const AxisMotion corner = motion.at(motion.leg_end_s(0));
  EXPECT_LT((corner.q_m - Eigen::Vector3d(0.5, 0, 0)).norm(), 1e-15);
  EXPECT_EQ(corner.velocity_m_per_s.norm(), 0.0);
  EXPECT_NEAR(motion.leg_begin_s(1) - motion.leg_end_s(0), 0.05, 1e-14);
  EXPECT_EQ(motion.at(0.5 * (motion.leg_begin_s(1) + motion.leg_end_s(0))).q_m, corner.q_m);
}

TEST(PathMotion, TakesTheTimeOfATrapezoidalSpeedProfile) {
  // 0.5 m at 0.1 m/s and 1 m/s^2: 5 s and one ramp time more.
  const PathMotion motion = l_shaped();
  EXPECT_NEAR(motion.leg_end_s(0) - motion.leg_begin_s(0), 5.1, 1e-12);
}

TEST(PathMotion, DeceleratesFromTheMiddleOfALegTooShortForTheFeed) {
  const PathMotion motion = l_shaped();
  EXPECT_NEAR(motion.leg_end_s(2) - motion.leg_begin_s(2), 2.0 * std::sqrt(1e-4 / 1.0), 1e-12);
}

TEST(PathMotion, VelocityIsTheSlopeOfThePosition) {
  const PathMotion motion = l_shaped();
  const double h = 1e-6;
  for (double t = 0.0101; t < motion.duration_s(); t += 0.0371) {
    const Eigen::Vector3d slope = (motion.at(t + h).q_m - motion.at(t - h).q_m) / (2.0 * h);
    // At a change of acceleration the difference is about acceleration x h = 1e-6.
    EXPECT_LT((slope - motion.at(t).velocity_m_per_s).norm(), 1e-5) << t;
  }
}

TEST(PathMotion, KeepsTheLastDirectionOfAnAxisThatStands) {
  const PathMotion motion = l_shaped();
  EXPECT_THAT(motion.at(0.0).direction, testing::ElementsAre(0, 0, 0));
  EXPECT_THAT(motion.at(2.0).direction, testing::ElementsAre(1, 0, 0));
  EXPECT_THAT(motion.at(motion.leg_begin_s(1) + 0.5).direction, testing::ElementsAre(1, -1, 0));
  EXPECT_THAT(motion.at(motion.duration_s()).direction, testing::ElementsAre(1, 1, 0));
}

TEST(PathMotion, MovesAtTheFeedOfTheNextVertex) {
  PathPlan plan;
  plan.vertices = {{{0, 0, 0}}, {{1, 0, 0}, 0.2}, {{0, 0, 0}}};
  plan.feed_m_per_s = 0.1;
  const PathMotion motion = PathMotion::plan(plan).value();
  EXPECT_DOUBLE_EQ(motion.at(motion.leg_begin_s(0) + 1.0).velocity_m_per_s.x(), 0.2);
  EXPECT_DOUBLE_EQ(motion.at(motion.leg_begin_s(1) + 1.0).velocity_m_per_s.x(), -0.1);
}

TEST(PathMotion, WithoutAVertexIsRefused) {
  EXPECT_FALSE(PathMotion::plan({}));
}

TEST(PathCsv, ReadsMillimetresAndFeed) {
  const auto path =
      parse_path_csv("# c\nx_mm,y_mm,z_mm,feed_mm_per_min\n1,2,3,\n-4.5,0,1e2,600\n", "p.csv")
          .value();
  ASSERT_EQ(path.size(), 2u);
  EXPECT_LT((path[1].q_m - Eigen::Vector3d(-4.5e-3, 0, 0.1)).norm(), 1e-16);
  EXPECT_EQ(path[0].feed_m_per_s, 0.0);
  EXPECT_DOUBLE_EQ(path[1].feed_m_per_s, 0.01);
}

TEST(PathCsv, NamesEveryBadLine) {
  const auto path = parse_path_csv("x_mm,y_mm,z_mm\n1,2\n1,2,x\n1,2,inf\n", "p.csv");
  ASSERT_FALSE(path);
  EXPECT_THAT(path.error().text, testing::HasSubstr("p.csv:2:4: 2 values, expected 3"));
  EXPECT_THAT(path.error().text, testing::HasSubstr("p.csv:3:5: z_mm: \"x\": not a number"));
  EXPECT_THAT(path.error().text, testing::HasSubstr("p.csv:4:5: z_mm: \"inf\": must be finite"));
}

TEST(PathCsv, OfASpreadsheetIsRefusedByName) {
  const auto fault = [](std::string_view text) {
    const auto path = parse_path_csv(text, "p.csv");
    return path ? std::string{} : path.error().text;
  };
  EXPECT_THAT(fault("x_mm;y_mm;z_mm\n1;2;3\n"), testing::HasSubstr("semicolons"));
  EXPECT_THAT(fault("x_mm\ty_mm\tz_mm\n1\t2\t3\n"), testing::HasSubstr("tabs"));
  EXPECT_THAT(fault("x_mm;y_mm;z_mm\n1,5;2;3\n"), testing::HasSubstr("decimal comma"));
  EXPECT_THAT(fault("1,2,3\n4,5,6\n"), testing::HasSubstr("the header line is missing"));
  EXPECT_THAT(fault("\xFF\xFEx"), testing::HasSubstr("UTF-16"));
}

TEST(PathCsv, WithARepeatedFaultNamesItOnceWithItsCount) {
  std::string text = "x_mm,y_mm,z_mm\n";
  for (int i = 0; i < 400; ++i) text += "1,2,x\n";
  const auto path = parse_path_csv(text, "p.csv");
  ASSERT_FALSE(path);
  EXPECT_EQ(path.error().text, "p.csv:2:5: z_mm: \"x\": not a number, and 399 more like this");
}

TEST(PathCsv, WithAnotherHeaderIsRefused) {
  EXPECT_FALSE(parse_path_csv("x,y,z\n1,2,3\n1,2,4\n", "p.csv"));
  EXPECT_FALSE(parse_path_csv("", "p.csv"));
}

}  // namespace
}  // namespace abbe::sim
