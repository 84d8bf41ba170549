#include "abbe/daemon/dds_bridge.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "abbe/daemon/cdr.hpp"
#include "abbe/daemon/dds_link.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using WallTime = DdsBridge::WallTime;

template <class T>
std::vector<std::byte> payload_of(const T& value) {
  std::vector<std::byte> payload;
  EXPECT_TRUE(encode(value, payload).has_value());
  return payload;
}

std::vector<std::byte> active(const std::string& machine, std::uint64_t sequence) {
  v1::ModelState state;
  state.machine(machine);
  state.sequence_number(sequence);
  state.state(v1::MODEL_ACTIVE);
  state.model_id("otf-1");
  return payload_of(state);
}

std::vector<std::byte> snapshot() {
  v1::Snapshot snapshot;
  snapshot.machine("m");
  return payload_of(snapshot);
}

std::vector<std::byte> model() {
  v1::ErrorModel model;
  model.machine("m");
  return payload_of(model);
}

std::vector<std::byte> slice(std::uint32_t number, std::uint32_t slices) {
  v1::ErrorGrid grid;
  grid.machine("m");
  grid.slice(number);
  grid.slices(slices);
  return payload_of(grid);
}

struct Recorded final : DdsOutlet {
  struct Write {
    Topic topic;
    std::vector<std::byte> payload;
  };
  std::vector<Write> writes;
  int assertions = 0;

  bool write(Topic topic, std::span<const std::byte> payload) override {
    writes.push_back({topic, {payload.begin(), payload.end()}});
    return true;
  }
  void dispose(Topic topic, std::span<const std::byte> payload) override {
    EXPECT_EQ(topic, Topic::ErrorGrid);
    disposed.push_back(payload_key(topic, payload)->number.value());
  }
  void assert_liveliness() override { ++assertions; }
  std::vector<std::uint32_t> disposed;

  [[nodiscard]] int count(Topic topic) const {
    int n = 0;
    for (const Write& w : writes) n += w.topic == topic;
    return n;
  }
  [[nodiscard]] v1::ModelState last_state() const {
    for (auto w = writes.rbegin(); w != writes.rend(); ++w) {
      if (w->topic == Topic::ModelState) return decode<v1::ModelState>(w->payload).value();
    }
    return {};
  }
};

struct DdsBridgeTest : testing::Test {
  Recorded outlet;
  DdsBridge bridge{outlet};
  WallTime t{1000s};

  /// abbed lives for `duration`: beats and turns every 50 ms.
  void live(std::chrono::milliseconds duration) {
    for (const WallTime end = t + duration; t < end; t += 50ms) {
      bridge.beat(t);
      bridge.turn(t);
    }
  }
  void silent(std::chrono::milliseconds duration) {
    for (const WallTime end = t + duration; t < end; t += 50ms) bridge.turn(t);
  }
};

TEST_F(DdsBridgeTest, WritesPayloadsUnchanged) {
  bridge.beat(t);
  bridge.publish(Topic::Snapshot, snapshot(), t);
  ASSERT_EQ(outlet.writes.size(), 1u);
  EXPECT_EQ(outlet.writes[0].payload, snapshot());
}

TEST_F(DdsBridgeTest, SlicesBeyondASmallerGridAreDisposedAndNotRepeated) {
  bridge.beat(t);
  for (std::uint32_t i = 0; i < 3; ++i) bridge.publish(Topic::ErrorGrid, slice(i, 3), t);
  bridge.publish(Topic::ErrorGrid, slice(0, 1), t);
  EXPECT_EQ(outlet.disposed, (std::vector<std::uint32_t>{1, 2}));
  const int written = outlet.count(Topic::ErrorGrid);
  live(10s + 50ms);
  EXPECT_EQ(outlet.count(Topic::ErrorGrid), written + 1);
}

TEST_F(DdsBridgeTest, SlicesOfAnAbbedBeforeAreDisposedToo) {
  bridge.beat(t);
  for (std::uint32_t i = 0; i < 3; ++i) bridge.publish(Topic::ErrorGrid, slice(i, 3), t);
  bridge.connected();
  bridge.publish(Topic::ErrorGrid, slice(0, 2), t);
  EXPECT_TRUE(outlet.disposed.empty());
  bridge.beat(t);
  bridge.turn(t);
  EXPECT_EQ(outlet.disposed, (std::vector<std::uint32_t>{2}));
}

TEST_F(DdsBridgeTest, WritesNothingBeforeTheFirstBeat) {
  bridge.publish(Topic::Snapshot, snapshot(), t);
  bridge.publish(Topic::ModelState, active("m", 1), t);
  silent(200ms);
  EXPECT_TRUE(outlet.writes.empty());
  live(50ms);
  EXPECT_EQ(outlet.count(Topic::ModelState), 1);
  EXPECT_EQ(outlet.count(Topic::Snapshot), 0) << "a live sample of the past does not count";
}

TEST_F(DdsBridgeTest, SilenceInvalidatesEveryMachineOnceAndWithin550Milliseconds) {
  live(100ms);
  bridge.publish(Topic::ModelState, active("a", 1), t);
  bridge.publish(Topic::ModelState, active("b", 1), t);
  silent(600ms);
  EXPECT_FALSE(bridge.source_alive());
  EXPECT_EQ(outlet.count(Topic::ModelState), 4);
  silent(20s);
  EXPECT_EQ(outlet.count(Topic::ModelState), 4);
}

TEST_F(DdsBridgeTest, InvalidStateSaysWhyAndKeepsTheModel) {
  live(100ms);
  bridge.publish(Topic::ModelState, active("m", 7), t);
  bridge.lost();
  const auto state = outlet.last_state();
  EXPECT_EQ(state.state(), v1::MODEL_INVALID);
  EXPECT_EQ(state.reason(), "SOURCE_LOST");
  EXPECT_EQ(state.model_id(), "otf-1");
  EXPECT_EQ(state.sequence_number(), 8u);
}

TEST_F(DdsBridgeTest, LivelinessIsAssertedOnlyWhileTheSourceIsAlive) {
  live(1000ms);
  EXPECT_EQ(outlet.assertions, 5);
  silent(550ms);
  const int until_silence = outlet.assertions;
  silent(5s);
  EXPECT_EQ(outlet.assertions, until_silence);
}

TEST_F(DdsBridgeTest, LiveSamplesStopWithTheSource) {
  live(100ms);
  silent(600ms);
  bridge.publish(Topic::Snapshot, snapshot(), t);
  EXPECT_EQ(outlet.count(Topic::Snapshot), 0);
}

TEST_F(DdsBridgeTest, BackAgainTheModelIsRepublishedButTheStateWaitsForTheSource) {
  live(100ms);
  bridge.publish(Topic::ErrorModel, model(), t);
  bridge.publish(Topic::ModelState, active("m", 1), t);
  silent(600ms);
  live(200ms);
  EXPECT_EQ(outlet.count(Topic::ErrorModel), 2);
  EXPECT_EQ(outlet.last_state().state(), v1::MODEL_INVALID);
  bridge.publish(Topic::ModelState, active("m", 3), t);
  EXPECT_EQ(outlet.last_state().state(), v1::MODEL_ACTIVE);
}

TEST_F(DdsBridgeTest, DurableTopicsAreRepeated) {
  live(100ms);
  bridge.publish(Topic::ErrorModel, model(), t);
  bridge.publish(Topic::ModelState, active("m", 1), t);
  live(30s + 50ms);
  EXPECT_EQ(outlet.count(Topic::ErrorModel), 4);
  EXPECT_EQ(outlet.count(Topic::ModelState), 31);
}

TEST_F(DdsBridgeTest, ANewSourceVoidsWhatTheOldOneSaid) {
  live(100ms);
  bridge.publish(Topic::ErrorModel, model(), t);
  bridge.publish(Topic::ModelState, active("m", 1), t);
  bridge.connected();
  EXPECT_EQ(outlet.last_state().state(), v1::MODEL_INVALID);
  outlet.writes.clear();
  live(20s);
  EXPECT_TRUE(outlet.writes.empty());
}

TEST_F(DdsBridgeTest, BytesThatAreNoPayloadAreRefused) {
  live(100ms);
  bridge.publish(Topic::ModelState, std::vector<std::byte>(16), t);
  EXPECT_EQ(bridge.refused(), 1u);
  EXPECT_TRUE(outlet.writes.empty());
}

TEST_F(DdsBridgeTest, FeedCarriesWhatTheLinkSends) {
  std::string name = testing::TempDir() + "abbe-feed-XXXXXX";
  const std::filesystem::path directory = ::mkdtemp(name.data());
  {
    std::optional<DdsLink> link(DdsLink::listen(directory / "dds.sock").value());
    DdsFeed feed(directory / "dds.sock", bridge);
    link->publish(Topic::ModelState, active("m", 1));
    while (outlet.writes.empty()) {
      feed.turn();
      link->poll();
      link->beat(std::chrono::steady_clock::now());
    }
    EXPECT_EQ(outlet.last_state().state(), v1::MODEL_ACTIVE);
    link.reset();
    while (feed.connected()) feed.turn();
    EXPECT_EQ(outlet.last_state().reason(), "SOURCE_LOST");
  }
  std::filesystem::remove_all(directory);
}

}  // namespace
}  // namespace abbe::daemon
