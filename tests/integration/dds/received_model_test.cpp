#include "abbe/dds/received_model.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <limits>

#include "sample_messages.hpp"

namespace abbe::dds {
namespace {

using namespace std::chrono_literals;

ReceivedModel complete() {
  ReceivedModel model;
  model.state(test::active_state(1));
  model.model(test::error_model());
  for (auto& slice : test::grid_slices()) model.slice(std::move(slice));
  return model;
}

TEST(ReceivedModel, CompleteActiveModelOfALivePublisherIsApplied) {
  EXPECT_TRUE(complete().decide(true).apply);
}

TEST(ReceivedModel, PublisherNotAliveIsARefusal) {
  EXPECT_EQ(complete().decide(false).reason, "the ModelState publisher is not alive");
}

TEST(ReceivedModel, AnyStateButActiveIsARefusal) {
  for (const auto status : {v1::MODEL_NONE, v1::MODEL_STALE, v1::MODEL_DRIFT, v1::MODEL_INVALID}) {
    auto model = complete();
    auto state = test::active_state(2);
    state.state(status);
    model.state(state);
    EXPECT_FALSE(model.decide(true).apply) << name_of(status);
  }
}

TEST(ReceivedModel, MissingSliceIsARefusal) {
  ReceivedModel model;
  model.state(test::active_state(1));
  model.slice(test::grid_slices()[0]);
  EXPECT_FALSE(model.decide(true).apply);
}

TEST(ReceivedModel, SlicesOfTwoModelsAreNeverMixed) {
  auto model = complete();
  auto other = test::grid_slices()[0];
  other.model_id("otf-2");
  const auto whole = model.grid()->size();
  model.slice(other);
  EXPECT_EQ(model.grid()->size(), whole);
  auto state = test::active_state(2);
  state.model_id("otf-2");
  model.state(state);
  EXPECT_FALSE(model.grid().has_value());
}

// What a late joiner may meet: the end of a larger grid that was there before, in any order.
TEST(ReceivedModel, SlicesLeftOfAnotherModelAreIgnored) {
  auto left = test::grid_slices().back();
  left.model_id("otf-before");
  left.slice(left.slices() + 1);
  left.slices(left.slices() + 2);

  for (const bool before : {true, false}) {
    ReceivedModel model;
    if (before) model.slice(left);
    for (auto& slice : test::grid_slices()) model.slice(std::move(slice));
    if (!before) model.slice(left);
    model.state(test::active_state(1));
    EXPECT_TRUE(model.grid().has_value()) << before;
    model.slice(left);
    EXPECT_TRUE(model.grid().has_value()) << before;
  }
}

TEST(ReceivedModel, GridOfAnotherModelThanTheStateIsARefusal) {
  auto model = complete();
  auto state = test::active_state(2);
  state.model_id("otf-2");
  model.state(state);
  EXPECT_FALSE(model.decide(true).apply);
}

TEST(Decide, AppliesAGoodVector) {
  EXPECT_TRUE(decide(test::compensation(1), 0ms, test::active_state(1), true).apply);
}

TEST(Decide, RefusesEachBreachOfTheRule) {
  const auto refused = [](auto&& spoil) {
    auto c = test::compensation(1);
    spoil(c);
    return !decide(c, 0ms, test::active_state(1), true).apply;
  };
  EXPECT_TRUE(refused([](auto& c) { c.inside(false); }));
  EXPECT_TRUE(refused([](auto& c) { c.tool_ok(false); }));
  EXPECT_TRUE(refused([](auto& c) { c.state(v1::MODEL_DRIFT); }));
  EXPECT_TRUE(refused([](auto& c) { c.age_ns(c.validity_ns() + 1); }));
  EXPECT_TRUE(refused([](auto& c) { c.model_id("another"); }));
}

TEST(Decide, IncludesTheVectorsWaitingTime) {
  const auto c = test::compensation(1);  // 1 of 500 ms old
  EXPECT_TRUE(decide(c, 499ms, test::active_state(1), true).apply);
  EXPECT_FALSE(decide(c, 500ms, test::active_state(1), true).apply);
}

/// A vector that was published at `host_time` of another clock, 2 ms after the instant it
/// describes.
v1::Compensation vector_of(std::chrono::nanoseconds host_time) {
  v1::Compensation c;
  c.host_time_ns((host_time - 2ms).count());
  c.age_ns(std::chrono::nanoseconds{2ms}.count());
  return c;
}

TEST(Delay, IsTheExcessOverTheFastestVector) {
  Delay delay;
  const Delay::Instant ours{5000s};
  for (auto t = 0ms; t <= 200ms; t += 10ms)
    EXPECT_FALSE(delay.of(vector_of(70s + t), ours + t + 300us));
  EXPECT_EQ(delay.of(vector_of(70s + 210ms), ours + 210ms + 200us), 0ns);
  const auto waited = delay.of(vector_of(70s + 220ms), ours + 420ms + 200us);
  EXPECT_NEAR(static_cast<double>(waited.value().count()), 200e6,
              50e3);  // less what clocks may drift apart
}

TEST(Delay, IgnoresTimesOutOfRange) {
  Delay delay;
  const Delay::Instant ours{5000s};
  for (auto t = 0ms; t <= 210ms; t += 10ms) (void)delay.of(vector_of(70s + t), ours + t);

  for (const auto time :
       {std::numeric_limits<std::int64_t>::max(), std::numeric_limits<std::int64_t>::min()}) {
    v1::Compensation strange = vector_of(70s);
    strange.host_time_ns(time);
    EXPECT_FALSE(delay.of(strange, ours + 220ms));
    strange.age_ns(time);
    EXPECT_FALSE(delay.of(strange, ours + 220ms));
    v1::Compensation aged = test::compensation(1);
    aged.age_ns(time);
    EXPECT_FALSE(decide(aged, 1ms, test::active_state(1), true).apply);
  }

  EXPECT_EQ(delay.of(vector_of(70s + 230ms), ours + 230ms), 0ns);
}

TEST(Delay, ALongSilenceDoesNotReduceTheDelayOfASlowVector) {
  Delay delay;
  const Delay::Instant ours{5000s};
  for (auto t = 0ms; t <= 200ms; t += 10ms) EXPECT_FALSE(delay.of(vector_of(70s + t), ours + t));
  EXPECT_GT(delay.of(vector_of(100s), ours + 30s + 5ms), 4ms);
}

TEST(Delay, IsKeptForTheNextPublisherIfItsClockIsTheSame) {
  Delay delay;
  const Delay::Instant ours{5000s};
  for (auto t = 0ms; t <= 210ms; t += 10ms) (void)delay.of(vector_of(70s + t), ours + t);
  Delay restarted = delay.for_next_publisher();
  EXPECT_GT(restarted.of(vector_of(70s + 500ms), ours + 502ms), 1900us);
  Delay another = delay.for_next_publisher();
  EXPECT_FALSE(another.of(vector_of(70s + 400ms), ours + 500ms));
}

TEST(Delay, FollowsAClockThatRunsSlowerBy150Ppm) {
  Delay delay;
  const Delay::Instant ours{5000s};
  for (int i = 0; i < 100'000; i += 100)
    EXPECT_LT(delay.of(vector_of(70s + i * 1ms), ours + i * 1ms + i * 150ns).value_or(0ns), 1ms)
        << i;
}

}  // namespace
}  // namespace abbe::dds
