#include "abbe/calib/mfb/observe/reading_mistakes.hpp"

#include <gtest/gtest.h>

#include <random>

#include "mfb_simulation.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::mfb;
using namespace abbe::tests::mfb;

class MfbReadingMistakes : public ::testing::Test {
 protected:
  void SetUp() override {
    std::mt19937_64 random(3);
    const SimulatedMachine machine(random);
    probed_ = probe(machine, plan_, random, {});
  }
  /// Changes every reading.
  template <class Change>
  void change(Change change) {
    for (std::size_t m = 0; m < probed_.touches.size(); ++m) {
      for (Touch& touch : probed_.touches[m]) {
        touch.reading_m = change(touch.reading_m, plan_.measurements[m].tool_offset_m);
      }
    }
  }
  [[nodiscard]] std::string corrections() const {
    return corrections_to_plan(probed_.bar, plan_, probed_.touches);
  }

  Plan plan_ = paper_plan();
  ProbedBar probed_;
};

TEST_F(MfbReadingMistakes, AreNotFoundInReadingsThatFit) {
  EXPECT_EQ(corrections(), "");
}

TEST_F(MfbReadingMistakes, AreReversedAndSwappedAxes) {
  change([](const Vector3& q, const Vector3&) { return Vector3(q.x(), -q.y(), q.z()); });
  EXPECT_EQ(corrections(), "; the readings fit the plan with Y reversed");
}

TEST_F(MfbReadingMistakes, AreWrongUnits) {
  change([](const Vector3& q, const Vector3&) { return Vector3(q / 1000.0); });
  EXPECT_EQ(corrections(), "; the readings fit the plan with lengths in m instead of mm");
}

TEST_F(MfbReadingMistakes, AreToolOffsetsOfTheOppositeSign) {
  for (Measurement& m : plan_.measurements) {
    m.tool_offset_m = -m.tool_offset_m;
  }
  EXPECT_EQ(corrections(), "; the readings fit the plan with tool offsets of the opposite sign");
}

TEST_F(MfbReadingMistakes, ArePositionsOfTheTip) {
  change([](const Vector3& q, const Vector3& t) { return Vector3(q + t); });
  EXPECT_EQ(corrections(),
            "; the readings fit the plan with positions of the tip instead of scale readings");
}

TEST_F(MfbReadingMistakes, AreExchangedMeasurements) {
  std::swap(probed_.touches[3], probed_.touches[4]);
  EXPECT_EQ(corrections(),
            "; the touches of Y1 fit measurement Y2; the touches of Y2 fit measurement Y1");
}

TEST_F(MfbReadingMistakes, AreNotFoundIfNothingExplainsTheReadings) {
  change([](const Vector3& q, const Vector3&) { return Vector3(q + Vector3(0.1, 0.2, 0.0)); });
  EXPECT_EQ(corrections(), "");
}

}  // namespace
