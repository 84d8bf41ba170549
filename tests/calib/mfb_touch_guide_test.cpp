// Touches of a simulated session with a bar: each fault of a shop floor is handled or named, and
// nothing acquired before is lost.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "abbe/calib/mfb/live/touch_guide.hpp"
#include "mfb_simulation.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::mfb;
using namespace abbe::tests::mfb;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// Two positions of the paper's plan, each forward and backward. The bar stands some mm and mrad
/// beside the plan.
class GuidedBar : public ::testing::Test {
 protected:
  GuidedBar() {
    plan.measurements.resize(2);
    plan = with_pairs(plan);
    std::mt19937_64 random(7);
    const SimulatedMachine truth(random);
    probed = probe(truth, plan, random, {.origin_m = 1e-3, .axes_rad = 2e-3});
    for (std::size_t pass = 0; pass < probed.touches.size(); ++pass) {
      for (const Touch& touch : probed.touches[pass]) {
        readings.push_back(touch.reading_m);
      }
    }
  }

  [[nodiscard]] TouchGuide guide() const {
    return *TouchGuide::create(probed.bar, plan, paper_machine());
  }

  /// Gives the readings one after the other; all notes.
  std::vector<std::string> take(TouchGuide& to, const std::vector<Vector3>& all) {
    std::vector<std::string> notes;
    for (const Vector3& reading_m : all) {
      for (const std::string& note : to.take(reading_m).notes) {
        notes.push_back(note);
      }
    }
    return notes;
  }
  void expect_all(const TouchGuide& of) const {
    ASSERT_TRUE(of.complete());
    for (std::size_t pass = 0; pass < probed.touches.size(); ++pass) {
      ASSERT_EQ(of.passes()[pass].size(), probed.touches[pass].size());
      for (std::size_t i = 0; i < probed.touches[pass].size(); ++i) {
        EXPECT_EQ(of.passes()[pass][i].target, probed.touches[pass][i].target);
        EXPECT_EQ(of.passes()[pass][i].reading_m, probed.touches[pass][i].reading_m);
      }
    }
  }
  [[nodiscard]] std::size_t per_pass() const { return probed.touches.front().size(); }
  /// The readings from number `from` to before `to`.
  [[nodiscard]] std::vector<Vector3> some(std::size_t from, std::size_t to) const {
    return {readings.begin() + static_cast<std::ptrdiff_t>(from),
            readings.begin() + static_cast<std::ptrdiff_t>(to)};
  }

  Plan plan = paper_plan();
  ProbedBar probed;
  std::vector<Vector3> readings;
};

TEST_F(GuidedBar, EveryTouchIsAssignedToItsPlace) {
  TouchGuide all = guide();
  EXPECT_EQ(all.planned(), readings.size());
  for (const Vector3& reading_m : readings) {
    const NextTouch next = all.next();
    const PassTouches& pass = probed.touches[next.measurement];
    EXPECT_EQ(next.target, pass[all.passes()[next.measurement].size()].target);
    const GuidedTouch taken = all.take(reading_m);
    ASSERT_EQ(taken.fate, TouchFate::Taken) << testing::PrintToString(taken.notes);
    ASSERT_THAT(taken.notes, IsEmpty());
  }
  expect_all(all);
  EXPECT_EQ(all.taken(), readings.size());
}

TEST_F(GuidedBar, TouchesByHandMayBeBesideTheirPlace) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> beside(-1e-3, 1e-3);
  const std::vector<NominalTouch> nominal = nominal_touches(probed.bar.pattern, plan.tip_radius_m);
  TouchGuide all = guide();
  for (std::size_t pass = 0; pass < probed.touches.size(); ++pass) {
    for (const Touch& touch : probed.touches[pass]) {
      // Along the axis of the feature the touch stays on its surface.
      const Vector3 axis = touch.target.feature == Feature::Hole  ? Vector3::UnitZ()
                           : touch.target.feature == Feature::Rod ? Vector3::UnitY()
                                                                  : Vector3::UnitX();
      const Vector3 off_m = beside(random) * (plan.measurements[pass].axes() * axis);
      const GuidedTouch taken = all.take(touch.reading_m + off_m);
      ASSERT_EQ(taken.fate, TouchFate::Taken) << testing::PrintToString(taken.notes);
      EXPECT_EQ(all.passes()[pass].back().target, touch.target);
    }
  }
  EXPECT_TRUE(all.complete());
}

TEST_F(GuidedBar, AMissedTouchIsNamedAndMayBeMadeLater) {
  TouchGuide all = guide();
  std::vector<Vector3> given = some(0, per_pass());
  const Vector3 missed_m = given[10];
  given.erase(given.begin() + 10);
  EXPECT_THAT(take(all, given), ElementsAre(AllOf(HasSubstr("X1: "), HasSubstr(", k = 2"),
                                                  HasSubstr("was not touched"))));
  EXPECT_EQ(all.next().measurement, 0u);
  EXPECT_EQ(all.next().target, probed.touches[0][10].target);
  EXPECT_EQ(all.take(missed_m).fate, TouchFate::Taken);
  EXPECT_EQ(all.next().measurement, 1u);
  EXPECT_EQ(all.passes()[0].size(), per_pass());
}

TEST_F(GuidedBar, APassMayEndWithoutATouch) {
  for (const std::size_t missed : {std::size_t{10}, per_pass() + 10, 2 * per_pass() - 1}) {
    TouchGuide all = guide();
    std::vector<Vector3> given = readings;
    given.erase(given.begin() + static_cast<std::ptrdiff_t>(missed));
    EXPECT_THAT(take(all, given), Contains(HasSubstr("ends without 1 of 316 touches"))) << missed;
    EXPECT_TRUE(all.complete()) << missed;
  }
}

TEST_F(GuidedBar, AFeatureWithTooFewTouchesIsAskedForAgain) {
  TouchGuide all = guide();
  std::vector<Vector3> given = some(0, per_pass() + 20);
  given.erase(given.begin() + 8, given.begin() + 20);
  take(all, given);
  EXPECT_EQ(all.next().measurement, 0u);
  EXPECT_EQ(all.next().target, probed.touches[0][8].target);
  take(all, some(8, 20));
  EXPECT_EQ(all.next().measurement, 1u);
}

TEST_F(GuidedBar, ATouchMadeTwiceCountsOnce) {
  std::vector<Vector3> more = readings;
  more.insert(more.begin() + 40, readings[39] + Vector3::Constant(1e-6));
  TouchGuide all = guide();
  EXPECT_THAT(take(all, more), ElementsAre(HasSubstr("was touched twice; it counts once")));
  expect_all(all);
}

TEST_F(GuidedBar, AnotherTouchAtATakenPlaceIsNotUsed) {
  std::vector<Vector3> more = readings;
  more.insert(more.begin() + 40, readings[30] + Vector3::Constant(0.2e-3));
  TouchGuide all = guide();
  EXPECT_THAT(take(all, more), ElementsAre(HasSubstr("has its touch already")));
  expect_all(all);
}

TEST_F(GuidedBar, ATouchInTheAirIsNamed) {
  std::vector<Vector3> more = readings;
  more.insert(more.begin() + 40, readings[40] + Vector3(0.0, 0.0, 40e-3));
  more.insert(more.begin() + 600, Vector3::Constant(std::numeric_limits<double>::quiet_NaN()));
  TouchGuide all = guide();
  EXPECT_THAT(take(all, more),
              ElementsAre(AllOf(HasSubstr("mm from the nearest place"), HasSubstr("expected: ")),
                          HasSubstr("is not a number")));
  expect_all(all);
}

/// The wrong touch is within the 5 mm in which the bar may stand beside the plan.
TEST_F(GuidedBar, TheFirstTouchMayBeWrong) {
  const Measurement& m = plan.measurements[0];
  const Vector3 planned_m =
      m.origin_m - m.tool_offset_m +
      m.axes() * nominal_touches(probed.bar.pattern, plan.tip_radius_m).front().tip_m;
  const Vector3 wrong_m = readings[0] + 4e-3 * (planned_m - readings[0]).normalized();
  TouchGuide all = guide();
  EXPECT_EQ(all.take(wrong_m).fate, TouchFate::Taken);
  EXPECT_THAT(all.take(readings[1]).notes, ElementsAre(HasSubstr("both are discarded")));
  EXPECT_EQ(all.taken(), 0u);
  EXPECT_THAT(take(all, readings), IsEmpty());
  expect_all(all);
}

/// The third pass with the shifts of the holes that a turned bar shows.
enum class Turned { AboutX, AboutZ };

std::vector<Vector3> turned_pass(const Measurement& m, TouchPattern pattern, double tip_radius_m,
                                 Turned turned) {
  for (double& y_m : pattern.hole_y_m) {
    y_m *= -1.02;
  }
  if (turned == Turned::AboutZ) {
    std::reverse(pattern.hole_y_m.begin(), pattern.hole_y_m.end());
  }
  const std::vector<NominalTouch> touches = nominal_touches(pattern, tip_radius_m);
  std::vector<Vector3> readings_m;
  for (const std::size_t place : probing_order(touches)) {
    readings_m.push_back(m.origin_m + m.axes() * touches[place].tip_m - m.tool_offset_m);
  }
  return readings_m;
}

TEST_F(GuidedBar, ATurnedBarIsRefusedAndTheOtherPassesAreKept) {
  for (const Turned turned : {Turned::AboutX, Turned::AboutZ}) {
    const Measurement& m = plan.measurements[2];
    TouchGuide all = guide();
    take(all, some(0, 2 * per_pass()));
    EXPECT_THAT(
        take(all, turned_pass(m, probed.bar.pattern, plan.tip_radius_m, turned)),
        Contains(AllOf(HasSubstr(m.name),
                       HasSubstr(turned == Turned::AboutX ? "turned about x" : "turned about z"),
                       HasSubstr("measure it again"))));
    EXPECT_EQ(all.passes()[0].size(), per_pass());
    EXPECT_EQ(all.passes()[1].size(), per_pass());
    EXPECT_THAT(all.passes()[2], IsEmpty());
    take(all, some(2 * per_pass(), readings.size()));
    expect_all(all);
  }
}

TEST_F(GuidedBar, AnotherBarFails) {
  Bar other = probed.bar;
  for (std::size_t i = 1; i + 1 < other.O_m.size(); ++i) {
    other.O_m[i].x() += 0.8e-3;
  }
  TouchGuide all = *TouchGuide::create(other, plan, paper_machine());
  take(all, some(0, per_pass()));
  take(all, some(0, per_pass()));
  ASSERT_TRUE(all.failure());
  EXPECT_THAT(all.failure()->text, AllOf(HasSubstr("2 passes were discarded"),
                                         HasSubstr("the bar file is that of another bar")));
}

TEST_F(GuidedBar, ABarThatMovesDuringAPassIsMeasuredAgain) {
  std::vector<Vector3> moved = some(0, per_pass());
  for (std::size_t i = per_pass() / 2; i < moved.size(); ++i) {
    moved[i] += Vector3(1.5e-3, 0.0, 0.0);
  }
  TouchGuide all = guide();
  EXPECT_THAT(take(all, moved), Contains(HasSubstr("measure it again")));
  EXPECT_FALSE(all.failure());
  EXPECT_EQ(all.next().measurement, 0u);
  take(all, readings);
  expect_all(all);
}

TEST_F(GuidedBar, APassInTheWrongDirectionIsRefusedAtItsFirstTouch) {
  std::vector<Vector3> reversed = some(0, per_pass());
  std::reverse(reversed.begin(), reversed.end());
  TouchGuide all = guide();
  const GuidedTouch first = all.take(reversed.front());
  EXPECT_EQ(first.fate, TouchFate::NotOnBar);
  EXPECT_THAT(first.notes, ElementsAre(AllOf(HasSubstr("X1: "), HasSubstr("expected: hole 1"))));
}

TEST_F(GuidedBar, AWrongStylusOrUnitFailsAfterSomeTouches) {
  for (const double factor : {25.4, 1e-3}) {
    TouchGuide all = guide();
    for (std::size_t i = 0; i < 30 && !all.failure(); ++i) {
      EXPECT_EQ(all.take(factor * readings[i + 40]).fate, TouchFate::NotOnBar);
    }
    ASSERT_TRUE(all.failure()) << factor;
    EXPECT_THAT(all.failure()->text, AllOf(HasSubstr("20 touches"), HasSubstr("tool offset")));
  }
}

TEST_F(GuidedBar, AnInterruptedSessionContinuesWhereItStopped) {
  TouchGuide before = guide();
  take(before, some(0, 500));
  TouchGuide after = guide();
  take(after, some(0, 500));  // the readings of the interrupted session
  EXPECT_EQ(after.next_text(), before.next_text());
  EXPECT_THAT(take(after, some(500, readings.size())), IsEmpty());
  expect_all(after);
}

TEST_F(GuidedBar, ThePassesAreIdentified) {
  TouchGuide all = guide();
  take(all, readings);
  const auto o = observe(probed.bar, plan, all.passes(), paper_machine());
  ASSERT_TRUE(o) << o.error().text;
  EXPECT_EQ(o->passes.size(), plan.measurements.size());
}

TEST_F(GuidedBar, APlanOutsideTheTravelIsRefused) {
  plan.measurements[0].origin_m.x() += 0.3;
  const auto refused = TouchGuide::create(probed.bar, plan, paper_machine());
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().text, HasSubstr("X1"));
}

}  // namespace
