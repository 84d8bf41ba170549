#include <gtest/gtest.h>

#include <vector>

#include "abbe/calib/probe/observe.hpp"

namespace abbe::calib::probe {
namespace {

TEST(ProbeObserve, TakesTheLargestSetOfOnePlaceFromOneSide) {
  std::vector<RecordedTouch> touches;
  for (const double v : {1e-3, 4e-3, 8e-3})
    for (int i = 0; i < 3; ++i) touches.push_back({{0.1, 0.2, 0.3 - v * 1e-3}, {0.0, 0.0, -v}});
  touches.push_back({{0.1, 0.2, 0.3}, {0.0, 0.0, 4e-3}});    // the other side
  touches.push_back({{0.15, 0.2, 0.3}, {0.0, 0.0, -4e-3}});  // another position
  touches.push_back({{0.1, 0.2, 0.3}, {0.0, 0.0, 0.0}});     // recorded without an approach
  const auto place = same_place(touches);
  ASSERT_EQ(place.size(), 9u);
  EXPECT_NEAR(place[8].speed_m_s, 8e-3, 1e-15);
  EXPECT_NEAR(place[8].along_m - place[0].along_m, 7e-6, 1e-12);
}

TEST(ProbeObserve, FindsTheDelayInThem) {
  std::vector<RecordedTouch> touches;
  for (const double v : {1e-3, 4e-3, 8e-3})
    for (int i = 0; i < 3; ++i) touches.push_back({{0.1, 0.2 + v * 2e-3, 0.3}, {0.0, v, 0.0}});
  const auto fit = fit_delay(same_place(touches));
  ASSERT_TRUE(fit) << fit.error().text;
  EXPECT_NEAR(fit->delay_s, 2e-3, 1e-9);
}

TEST(ProbeObserve, TheNormalPointsAgainstTheApproach) {
  const std::vector<RecordedTouch> one = {{{1.0, 2.0, 3.0}, {0.0, 0.0, -2e-3}}};
  EXPECT_EQ(around_sphere(one)[0].normal, Vector3::UnitZ());
}

}  // namespace
}  // namespace abbe::calib::probe
