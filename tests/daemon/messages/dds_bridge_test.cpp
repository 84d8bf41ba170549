#include "abbe/messages/dds_bridge.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "abbe/messages/cdr.hpp"
#include "abbe/messages/dds_link.hpp"

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

std::vector<std::byte> vector_of_age(std::chrono::nanoseconds age) {
  v1::Compensation vector;
  vector.machine("m");
  vector.age_ns(age.count());
  return payload_of(vector);
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
  [[nodiscard]] std::chrono::nanoseconds last_age() const {
    return std::chrono::nanoseconds{
        decode<v1::Compensation>(writes.back().payload).value().age_ns()};
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

  /// abbed runs for `duration`: a beat and a cycle every 50 ms.
  void live(std::chrono::milliseconds duration) {
    for (const WallTime end = t + duration; t < end; t += 50ms) {
      bridge.beat(t, t);
      bridge.cycle(t);
    }
  }
  void silent(std::chrono::milliseconds duration) {
    for (const WallTime end = t + duration; t < end; t += 50ms) bridge.cycle(t);
  }
  void publish(Topic topic, std::vector<std::byte> payload,
               std::chrono::milliseconds waited = 0ms) {
    bridge.publish(topic, payload, t - waited, t);
  }
};

TEST_F(DdsBridgeTest, WritesPayloadsUnchanged) {
  bridge.beat(t, t);
  publish(Topic::Snapshot, snapshot());
  ASSERT_EQ(outlet.writes.size(), 1u);
  EXPECT_EQ(outlet.writes[0].payload, snapshot());
}

TEST_F(DdsBridgeTest, SlicesBeyondASmallerGridAreDisposedAndNotRepeated) {
  bridge.beat(t, t);
  for (std::uint32_t i = 0; i < 3; ++i) publish(Topic::ErrorGrid, slice(i, 3));
  publish(Topic::ErrorGrid, slice(0, 1));
  EXPECT_EQ(outlet.disposed, (std::vector<std::uint32_t>{1, 2}));
  const int written = outlet.count(Topic::ErrorGrid);
  live(10s + 50ms);
  EXPECT_EQ(outlet.count(Topic::ErrorGrid), written + 1);
}

TEST_F(DdsBridgeTest, SlicesOfAnEarlierAbbedAreDisposedToo) {
  bridge.beat(t, t);
  for (std::uint32_t i = 0; i < 3; ++i) publish(Topic::ErrorGrid, slice(i, 3));
  bridge.connected();
  publish(Topic::ErrorGrid, slice(0, 2));
  EXPECT_TRUE(outlet.disposed.empty());
  bridge.beat(t, t);
  bridge.cycle(t);
  EXPECT_EQ(outlet.disposed, (std::vector<std::uint32_t>{2}));
}

TEST_F(DdsBridgeTest, WritesNothingBeforeTheFirstBeat) {
  publish(Topic::Snapshot, snapshot());
  publish(Topic::ModelState, active("m", 1));
  silent(200ms);
  EXPECT_TRUE(outlet.writes.empty());
  live(50ms);
  EXPECT_EQ(outlet.count(Topic::ModelState), 1);
  EXPECT_EQ(outlet.count(Topic::Snapshot), 0) << "a live sample of the past does not count";
}

TEST_F(DdsBridgeTest, SilenceInvalidatesEveryMachineOnceAndWithin550Milliseconds) {
  live(100ms);
  publish(Topic::ModelState, active("a", 1));
  publish(Topic::ModelState, active("b", 1));
  silent(600ms);
  EXPECT_FALSE(bridge.source_alive());
  EXPECT_EQ(outlet.count(Topic::ModelState), 4);
  silent(20s);
  EXPECT_EQ(outlet.count(Topic::ModelState), 4);
}

TEST_F(DdsBridgeTest, InvalidStateStatesTheReasonAndKeepsTheModel) {
  live(100ms);
  publish(Topic::ModelState, active("m", 7));
  bridge.lost();
  const auto state = outlet.last_state();
  EXPECT_EQ(state.state(), v1::MODEL_INVALID);
  EXPECT_EQ(state.reason(), "SOURCE_LOST");
  EXPECT_EQ(state.model_id(), "otf-1");
  EXPECT_EQ(state.sequence_number(), 8u);
}

TEST_F(DdsBridgeTest, LivelinessIsAssertedOnlyWhileTheSourceSends) {
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
  publish(Topic::Snapshot, snapshot());
  EXPECT_EQ(outlet.count(Topic::Snapshot), 0);
}

TEST_F(DdsBridgeTest, AfterAReconnectionTheModelIsRepublishedButTheStateWaitsForTheSource) {
  live(100ms);
  publish(Topic::ErrorModel, model());
  publish(Topic::ModelState, active("m", 1));
  silent(600ms);
  live(200ms);
  EXPECT_EQ(outlet.count(Topic::ErrorModel), 2);
  EXPECT_EQ(outlet.last_state().state(), v1::MODEL_INVALID);
  publish(Topic::ModelState, active("m", 3));
  EXPECT_EQ(outlet.last_state().state(), v1::MODEL_ACTIVE);
}

TEST_F(DdsBridgeTest, DurableTopicsAreRepeated) {
  live(100ms);
  publish(Topic::ErrorModel, model());
  publish(Topic::ModelState, active("m", 1));
  live(30s + 50ms);
  EXPECT_EQ(outlet.count(Topic::ErrorModel), 4);
  EXPECT_EQ(outlet.count(Topic::ModelState), 31);
}

TEST_F(DdsBridgeTest, ANewSourceInvalidatesTheMessagesOfTheOldOne) {
  live(100ms);
  publish(Topic::ErrorModel, model());
  publish(Topic::ModelState, active("m", 1));
  bridge.connected();
  EXPECT_EQ(outlet.last_state().state(), v1::MODEL_INVALID);
  outlet.writes.clear();
  live(20s);
  EXPECT_TRUE(outlet.writes.empty());
}

TEST_F(DdsBridgeTest, BytesThatAreNoPayloadAreRefused) {
  live(100ms);
  publish(Topic::ModelState, std::vector<std::byte>(16));
  EXPECT_EQ(bridge.refused(), 1u);
  EXPECT_TRUE(outlet.writes.empty());
}

TEST_F(DdsBridgeTest, AVectorsAgeIncludesItsTimeInTransit) {
  live(100ms);
  publish(Topic::Compensation, vector_of_age(3ms), 40ms);
  EXPECT_EQ(outlet.last_age(), 43ms);
}

TEST_F(DdsBridgeTest, LiveSamplesThatWaitedLongerThanATenthOfASecondAreDiscarded) {
  live(100ms);
  publish(Topic::Compensation, vector_of_age(3ms), 101ms);
  publish(Topic::Snapshot, snapshot(), 101ms);
  EXPECT_TRUE(outlet.writes.empty());
  EXPECT_EQ(bridge.outdated(), 2u);
}

// abbe-dds was stopped for 3 s: it then reads beats and states that were sent during the stop.
TEST_F(DdsBridgeTest, MessagesSentBeforeAStallDoNotAssertLiveliness) {
  live(100ms);
  publish(Topic::ModelState, active("m", 1));
  t += 3s;
  const int assertions = outlet.assertions;
  bridge.beat(t - 2900ms, t);
  publish(Topic::ModelState, active("m", 3), 2800ms);
  EXPECT_EQ(outlet.count(Topic::ModelState), 1);
  bridge.cycle(t);
  EXPECT_EQ(outlet.last_state().reason(), "SOURCE_LOST");
  EXPECT_EQ(outlet.assertions, assertions);
}

TEST_F(DdsBridgeTest, AStallOfAbbeDdsDoesNotCountAsSilenceOfAbbed) {
  live(100ms);
  publish(Topic::ModelState, active("m", 1));
  t += 800ms;
  for (auto ago = 700ms; ago > 0ms; ago -= 100ms) bridge.beat(t - ago, t);
  bridge.cycle(t);
  EXPECT_TRUE(bridge.source_alive());
  EXPECT_EQ(outlet.last_state().state(), v1::MODEL_ACTIVE);
}

/// abbed's end of the socket and this one.
struct DdsFeedTest : DdsBridgeTest {
  DdsFeedTest() {
    link.emplace(DdsLink::listen(directory / "dds.sock").value());
    feed.emplace(directory / "dds.sock", bridge);
  }
  ~DdsFeedTest() override { std::filesystem::remove_all(directory); }
  void run_until(const auto& done) {
    while (!done()) {
      feed->cycle();
      link->poll();
      link->beat(std::chrono::steady_clock::now());
    }
  }
  std::filesystem::path directory = [] {
    std::string name = testing::TempDir() + "abbe-feed-XXXXXX";
    return std::filesystem::path{::mkdtemp(name.data())};
  }();
  std::optional<DdsLink> link;
  std::optional<DdsFeed> feed;
};

TEST_F(DdsFeedTest, CarriesWhatTheLinkSends) {
  link->publish(Topic::ModelState, active("m", 1));
  run_until([this] { return !outlet.writes.empty(); });
  EXPECT_EQ(outlet.last_state().state(), v1::MODEL_ACTIVE);
  link.reset();
  while (feed->connected()) feed->cycle();
  EXPECT_EQ(outlet.last_state().reason(), "SOURCE_LOST");
}

TEST_F(DdsFeedTest, CountsFromTheInstantOfTheSender) {
  run_until([this] { return bridge.source_alive(); });
  link->publish(Topic::Compensation, vector_of_age(3ms), std::chrono::steady_clock::now() - 1s);
  run_until([this] { return bridge.outdated() == 1; });
  link->publish(Topic::Compensation, vector_of_age(3ms), std::chrono::steady_clock::now() - 20ms);
  run_until([this] { return !outlet.writes.empty() || bridge.outdated() == 2; });
  if (bridge.outdated() == 2) GTEST_SKIP() << "this process was held up for 80 ms";
  EXPECT_GE(outlet.last_age(), 23ms);
}

}  // namespace
}  // namespace abbe::daemon
