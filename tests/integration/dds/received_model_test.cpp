#include "abbe/dds/received_model.hpp"

#include <gtest/gtest.h>

#include "sample_messages.hpp"

namespace abbe::dds {
namespace {

ReceivedModel complete() {
  ReceivedModel model;
  model.state(test::active_state(1));
  model.model(test::error_model());
  for (auto& slice : test::grid_slices()) model.slice(std::move(slice));
  return model;
}

TEST(ReceivedModel, CompleteActiveAndAnsweredForIsApplied) {
  EXPECT_TRUE(complete().decide(true).apply);
}

TEST(ReceivedModel, NobodyAnsweringIsARefusal) {
  EXPECT_EQ(complete().decide(false).reason, "nobody answers for ModelState");
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
  EXPECT_TRUE(decide(test::compensation(1), test::active_state(1), true).apply);
}

TEST(Decide, RefusesEachBreachOfTheRule) {
  const auto refused = [](auto&& spoil) {
    auto c = test::compensation(1);
    spoil(c);
    return !decide(c, test::active_state(1), true).apply;
  };
  EXPECT_TRUE(refused([](auto& c) { c.inside(false); }));
  EXPECT_TRUE(refused([](auto& c) { c.tool_ok(false); }));
  EXPECT_TRUE(refused([](auto& c) { c.state(v1::MODEL_DRIFT); }));
  EXPECT_TRUE(refused([](auto& c) { c.age_ns(c.validity_ns() + 1); }));
  EXPECT_TRUE(refused([](auto& c) { c.model_id("another"); }));
}

}  // namespace
}  // namespace abbe::dds
