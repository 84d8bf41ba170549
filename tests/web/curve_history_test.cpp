/// The values of the last minutes and hours, as the page asks for them.

#include "abbe/web/curve_history.hpp"

#include <gmock/gmock.h>

#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string>

namespace abbe::web {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;
using ::testing::ElementsAre;
using Time = CurveHistory::Clock::time_point;

const CurveName kX{"Linear axes", "X", "mm"};
/// At the beginning of a bucket of every window.
constexpr Time kBegin{std::chrono::hours{100}};

struct CurveHistoryTest : testing::Test {
  [[nodiscard]] json window(std::string_view name, Time now, std::int64_t since = 0) const {
    return json::parse(history_.window(name, since, now).value());
  }
  /// One value in each half second of [from, until).
  void add_steadily(Time from, Time until, double value = 1.0) {
    for (Time at = from; at < until; at += 500ms) history_.add(kX, value, at);
  }
  CurveHistory history_;
};

TEST_F(CurveHistoryTest, ABucketHasSmallestLargestAndMeanValue) {
  for (const double value : {3.0, 1.0, 5.0}) history_.add(kX, value, kBegin + 10ms);
  const json answer = window("5min", kBegin + 20ms);
  const json& curve = answer["curves"][0];
  EXPECT_EQ(curve["group"], "Linear axes");
  EXPECT_EQ(curve["unit"], "mm");
  EXPECT_EQ(curve["min"].back(), 1.0);
  EXPECT_EQ(curve["max"].back(), 5.0);
  EXPECT_EQ(curve["mean"].back(), 3.0);
}

TEST_F(CurveHistoryTest, AStepWithoutAValueIsNull) {
  history_.add(kX, 1.0, kBegin);
  history_.add(kX, 2.0, kBegin + 2s);
  const auto first = kBegin.time_since_epoch() / 1s;
  const json answer = window("5min", kBegin + 2s, first);
  EXPECT_EQ(answer["curves"][0]["mean"], json({1.0, nullptr, 2.0}));
  EXPECT_TRUE(answer["curves"][0]["gaps"].empty()) << "2 s are no gap";
}

TEST_F(CurveHistoryTest, AGapInsideALongStepIsNamed) {
  add_steadily(kBegin, kBegin + 10s);
  add_steadily(kBegin + 20s, kBegin + 40s);
  const auto step = kBegin.time_since_epoch() / 40s;
  const json answer = window("8h", kBegin + 39s, step);
  EXPECT_EQ(answer["curves"][0]["mean"].size(), 1u) << "the step has values";
  EXPECT_THAT(answer["curves"][0]["gaps"], ElementsAre(step));
}

TEST_F(CurveHistoryTest, AllWindowsKeepTheirLengthAndNotMore) {
  add_steadily(kBegin, kBegin + 9h);
  for (const CurveWindow& w : CurveHistory::kWindows) {
    const json answer = window(w.name, kBegin + 9h - 1ms);
    const json& mean = answer["curves"][0]["mean"];
    EXPECT_EQ(mean.size(), w.buckets()) << w.name;
    EXPECT_EQ(answer["length"], w.buckets());
    EXPECT_FALSE(mean.front().is_null()) << w.name;
    EXPECT_FALSE(mean.back().is_null()) << w.name;
  }
}

TEST_F(CurveHistoryTest, WhatIsOlderThanTheWindowIsNotShownAgain) {
  add_steadily(kBegin, kBegin + 5min);
  EXPECT_FALSE(window("5min", kBegin + 6min)["curves"].empty());
  EXPECT_TRUE(window("5min", kBegin + 11min)["curves"].empty());
  EXPECT_FALSE(window("1h", kBegin + 11min)["curves"].empty());
}

TEST_F(CurveHistoryTest, AnAnswerHasTheBucketsFromTheOneThatWasAskedFor) {
  add_steadily(kBegin, kBegin + 1min);
  const auto first = kBegin.time_since_epoch() / 1s;
  const json newest = window("5min", kBegin + 59s, first + 57);
  EXPECT_EQ(newest["first"], first + 57);
  EXPECT_EQ(newest["curves"][0]["mean"].size(), 3u);
  for (const std::int64_t since : {first + 1000, first - 1000, std::int64_t{-1}})
    EXPECT_EQ(window("5min", kBegin + 59s, since)["length"], 301) << since;
}

TEST_F(CurveHistoryTest, ValuesThatAreNoNumbersAreNotKept) {
  history_.add(kX, std::nan(""), kBegin);
  history_.add(kX, HUGE_VAL, kBegin);
  EXPECT_TRUE(window("5min", kBegin)["curves"].empty());
}

TEST_F(CurveHistoryTest, AnUnknownWindowHasNoAnswer) {
  EXPECT_FALSE(history_.window("2h", 0, kBegin));
}

TEST_F(CurveHistoryTest, MoreCurvesThanItKeepsAreReported) {
  const auto add_all = [this](const std::string& prefix, Time at) {
    for (std::size_t i = 0; i < CurveHistory::kMostCurves; ++i)
      history_.add({"Temperatures", prefix + std::to_string(i), "C"}, 20.0, at);
  };
  add_all("a", kBegin);
  EXPECT_EQ(window("5min", kBegin)["left_out"], false);
  history_.add(kX, 1.0, kBegin);
  EXPECT_EQ(window("5min", kBegin)["left_out"], true);
  EXPECT_EQ(window("5min", kBegin)["curves"].size(), CurveHistory::kMostCurves);
  add_all("b", kBegin + 9h);  // the others have no value any more
  const json later = window("5min", kBegin + 9h);
  EXPECT_EQ(later["curves"].size(), CurveHistory::kMostCurves);
  EXPECT_EQ(later["curves"][0]["name"], "b0");
  EXPECT_EQ(later["left_out"], false);
}

}  // namespace
}  // namespace abbe::web
