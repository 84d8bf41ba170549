#include "abbe/drivers/lines/survey.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <string>

namespace abbe::drivers {
namespace {

using namespace std::chrono_literals;
using protocol::HostTime;
using protocol::lines::TimeUnit;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::Pair;

/// A line for each point from number `n`, 4 ms apart.
using Print = std::function<std::string(int n)>;

/// 3 s of points, in bursts of 83.
LineSurvey survey_of(const Print& print, bool datagrams = false) {
  LineSurvey survey{datagrams, false};
  int n = 0;
  for (HostTime now{100s}; now < HostTime{103s}; now += 332ms) {
    std::string text;
    for (int i = 0; i < 83; ++i) text += print(n++) + "\n";
    survey.push(std::as_bytes(std::span{text}), now);
  }
  return survey;
}

std::string point(int n) {
  return fmt::format("{:.3f} 1523.{:03} -310.5 88.1 OK", 1764571234.0 + 0.004 * n, n % 7);
}

TEST(LineSurvey, FindsColumnsRateAndBursts) {
  const auto found = survey_of(point).findings();
  EXPECT_EQ(found.lines, 830u);
  EXPECT_EQ(found.different, 0u);
  ASSERT_EQ(found.columns.size(), 5u);
  EXPECT_EQ(found.burst_period, 332ms);
  EXPECT_EQ(found.most_in_burst, 83u);
  EXPECT_EQ(found.point_rate_hz, 250.0);
  EXPECT_EQ(found.columns[0].time, TimeUnit::Seconds);
  EXPECT_FALSE(found.columns[1].rises);
  EXPECT_THAT(found.columns[4].words, ElementsAre(Pair("OK", 830u)));
}

TEST(LineSurvey, FindsTheUnitOfTheTime) {
  const auto unit = [](double per_s, int digits) {
    const auto print = [=](int n) {
      return fmt::format("{:.{}f} 1.5 2.5 3.5", per_s * (5.0 + 0.004 * n), digits);
    };
    return survey_of(print).findings().columns[0].time;
  };
  EXPECT_EQ(unit(1.0, 3), TimeUnit::Seconds);
  EXPECT_EQ(unit(1e3, 0), TimeUnit::Milliseconds);
  EXPECT_EQ(unit(1e6, 0), TimeUnit::Microseconds);
  EXPECT_EQ(unit(1e9, 0), TimeUnit::Nanoseconds);
  EXPECT_EQ(unit(60.0, 3), std::nullopt);
}

TEST(LineSurvey, TakesNoCounterOfTheLinesForATime) {
  const auto found = survey_of([](int n) { return fmt::format("{} 1.5 2.5 3.5", n); }).findings();
  EXPECT_TRUE(found.columns[0].rises);
  EXPECT_EQ(found.columns[0].time, std::nullopt);
  EXPECT_EQ(found.point_rate_hz, 0.0);
}

TEST(LineSurvey, FindsNoRateIfTwoColumnsAdvanceAsTime) {
  const auto print = [](int n) { return fmt::format("{0:.3f} {0:.3f} 1.5 2.5", 0.004 * n); };
  EXPECT_EQ(survey_of(print).findings().point_rate_hz, 0.0);
}

TEST(LineSurvey, FindsNoRateOfASenderWithJitterAndRoundsNoOther) {
  const auto rate_hz = [](const std::function<double(int)>& time_s) {
    return survey_of([&](int n) { return fmt::format("{:.6f} 1.5 2.5 3.5", time_s(n)); })
        .findings()
        .point_rate_hz;
  };
  EXPECT_NEAR(rate_hz([](int n) { return n / 250.4; }), 250.4, 0.05);
  EXPECT_EQ(rate_hz([](int n) { return 0.004 * n + (n % 9 == 0 ? 0.0039 : 0.0); }), 250.0)
      << "one late point in nine";
  EXPECT_EQ(rate_hz([](int n) { return 0.004 * n + (n % 2 == 0 ? 0.0 : 0.003); }), 0.0);
}

TEST(LineSurvey, FindsSeparatorAndDecimalSign) {
  const auto splits = [](const std::string& line) {
    return survey_of([&](int) { return line; }).findings().splits;
  };
  EXPECT_THAT(splits("1.5 2.5 -3.5"), ElementsAre(LineSplit{' ', '.'}));
  EXPECT_THAT(splits("1.5\t2.5\t-3.5"), ElementsAre(LineSplit{'\t', '.'}));
  EXPECT_THAT(splits("1,5;2,5;-3,5"), ElementsAre(LineSplit{';', ','}));
  EXPECT_THAT(splits("1.5, 2.5, -3.5"), ElementsAre(LineSplit{',', '.'}));
  EXPECT_THAT(splits("1,5 2,5 -3,5 OK"), ElementsAre(LineSplit{' ', ','}));
  EXPECT_THAT(splits("P1 measured"), IsEmpty());
}

TEST(LineSurvey, TakesAStatedSplit) {
  const auto survey = survey_of([](int) { return "1.5;2.5;3.5"; });
  EXPECT_EQ(survey.findings(LineSplit{',', '.'}).columns.size(), 1u);
}

TEST(LineSurvey, CountsLinesThatDiffer) {
  const auto print = [](int n) { return n % 83 == 5 ? std::string{"lost beam"} : point(n); };
  const auto found = survey_of(print).findings();
  EXPECT_EQ(found.different, 10u);
  EXPECT_EQ(found.columns.size(), 5u);
}

TEST(LineSurvey, KeepsTheHeading) {
  const auto print = [](int n) { return n == 0 ? std::string{"time x y z status"} : point(n); };
  const auto found = survey_of(print).findings();
  EXPECT_EQ(found.heading, "time x y z status");
  EXPECT_EQ(found.lines, 829u);
}

TEST(LineSurvey, EndsALineWithItsDatagram) {
  LineSurvey survey{true, false};
  for (const std::string text : {"1.5 2.5 3.5", "1.5 2.5 3.6"})
    survey.push(std::as_bytes(std::span{text}), HostTime{1s});
  EXPECT_EQ(survey.lines().size(), 2u);
}

TEST(LineSurvey, FindsNothingWithoutLines) {
  const LineSurvey survey{false, false};
  EXPECT_EQ(survey.findings().lines, 0u);
  EXPECT_THAT(survey.findings().columns, IsEmpty());
}

}  // namespace
}  // namespace abbe::drivers
