#include "abbe/publishing/publisher.hpp"

#include <gmock/gmock.h>
#include <stdlib.h>

#include <optional>

#include "dds_far_end.hpp"
#include "synthetic_model.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using protocol::HostTime;
using test::FarEnd;
using test::messages;
using ::testing::SizeIs;
using v1::ModelStatus;
using WallTime = Publisher::WallTime;

constexpr HostTime kPublishTime{100s};
constexpr WallTime kWall{50s};

const PublishedModel kPublishedModel{.id = "m", .method = "otf", .model = test::synthetic_model(1)};
const ModelPublication kPublication = encode_model(kPublishedModel, "mill").value();

protocol::Snapshot view() {
  protocol::Snapshot v;
  v.head.time = kPublishTime;
  v.axis_count = 3;
  v.position = {0.01, -0.02, -0.25};
  return v;
}

ActiveModelState active(std::uint64_t revision = 1) {
  return {.status = ModelStatus::MODEL_ACTIVE,
          .reason = "accepted",
          .model = &kPublishedModel,
          .publication = &kPublication,
          .revision = revision};
}

class PublisherTest : public ::testing::Test {
 protected:
  PublisherTest() {
    std::string name = testing::TempDir() + "abbe-publisher-XXXXXX";
    directory_ = ::mkdtemp(name.data());
    open({.machine = "mill", .tool_offset_m = {0.02, -0.015, -0.12}});
  }
  ~PublisherTest() override { std::filesystem::remove_all(directory_); }

  void open(PublisherOptions options) {
    far_.reset();
    publisher_.reset();
    publisher_.emplace(DdsLink::listen(directory_ / "dds.sock").value(), std::move(options),
                       protocol::UtcOffset{});
    far_.emplace(directory_ / "dds.sock");
    publisher_->beat(kWall);
  }
  void publish_live(const protocol::Snapshot& view, const ActiveModelState& state,
                    protocol::HostTime now, Publisher::WallTime wall) {
    publisher_->snapshot(view, now, wall);
    publisher_->compensation(view, state, now, wall);
  }
  template <class T>
  std::vector<T> taken(Topic topic) {
    return messages<T>(far_->take(), topic);
  }

  std::filesystem::path directory_;
  std::optional<Publisher> publisher_;
  std::optional<FarEnd> far_;
};

TEST_F(PublisherTest, LiveVectorsKeepToTheirRates) {
  std::size_t snapshots = 0, compensations = 0;
  for (auto t = 0ms; t < 1s; t += 1ms) {
    publish_live(view(), active(), kPublishTime + t, kWall + t);
    const auto seen = far_->take();
    snapshots += messages<v1::Snapshot>(seen, Topic::Snapshot).size();
    compensations += messages<v1::Compensation>(seen, Topic::Compensation).size();
  }
  EXPECT_EQ(snapshots, 50u);
  EXPECT_EQ(compensations, 100u);
}

TEST_F(PublisherTest, ARateOfZeroIsEveryTime) {
  open({.machine = "mill", .snapshot_hz = 0.0, .compensation_hz = 0.0});
  for (int i = 0; i < 5; ++i) publish_live(view(), active(), kPublishTime, kWall);
  const auto seen = far_->take();
  EXPECT_THAT(messages<v1::Snapshot>(seen, Topic::Snapshot), SizeIs(5));
  EXPECT_THAT(messages<v1::Compensation>(seen, Topic::Compensation), SizeIs(5));
}

TEST_F(PublisherTest, ACompensationCarriesTheStateOfTheModel) {
  auto state = active();
  state.status = ModelStatus::MODEL_STALE;
  publish_live(view(), state, kPublishTime + 2ms, kWall);
  const auto sent = taken<v1::Compensation>(Topic::Compensation);
  ASSERT_THAT(sent, SizeIs(1));
  EXPECT_EQ(sent[0].state(), ModelStatus::MODEL_STALE);
  EXPECT_EQ(sent[0].age_ns(), 2'000'000);
}

TEST_F(PublisherTest, AnAxisThatBecomesMissingIsPublishedAtOnce) {
  publish_live(view(), active(), kPublishTime, kWall);
  auto broken = view();
  broken.head.time += 1ms;
  broken.missing_mask = 0b010;
  publish_live(broken, active(), kPublishTime + 1ms, kWall + 1ms);
  const auto seen = far_->take();
  EXPECT_THAT(messages<v1::Snapshot>(seen, Topic::Snapshot), SizeIs(2));
  const auto sent = messages<v1::Compensation>(seen, Topic::Compensation);
  ASSERT_THAT(sent, SizeIs(2));
  EXPECT_EQ(sent[1].state(), ModelStatus::MODEL_STALE);
}

TEST_F(PublisherTest, AnAxisThatStaysMissingKeepsToTheRate) {
  auto broken = view();
  broken.missing_mask = 0b010;
  for (auto t = 0ms; t < 10ms; t += 1ms)
    publish_live(t < 1ms ? view() : broken, active(), kPublishTime + t, kWall + t);
  EXPECT_THAT(taken<v1::Compensation>(Topic::Compensation), SizeIs(2));
}

TEST_F(PublisherTest, WithAnAxisMissingNoCompensationIsActive) {
  auto broken = view();
  broken.missing_mask = 0b010;
  publish_live(broken, active(), kPublishTime, kWall);
  const auto sent = taken<v1::Compensation>(Topic::Compensation);
  ASSERT_THAT(sent, SizeIs(1));
  EXPECT_EQ(sent[0].state(), ModelStatus::MODEL_STALE);
}

TEST_F(PublisherTest, WithoutAxesThereIsASnapshotAndNoCompensation) {
  publish_live({}, active(), kPublishTime, kWall);
  const auto seen = far_->take();
  EXPECT_THAT(messages<v1::Snapshot>(seen, Topic::Snapshot), SizeIs(1));
  EXPECT_THAT(messages<v1::Compensation>(seen, Topic::Compensation), SizeIs(0));
}

TEST_F(PublisherTest, ModelAndGridGoOutOncePerRevision) {
  for (int turn = 0; turn < 3; ++turn) publisher_->model(active(1), kPublishTime, kWall);
  auto seen = far_->take();
  EXPECT_THAT(messages<v1::ErrorModel>(seen, Topic::ErrorModel), SizeIs(1));
  EXPECT_FALSE(messages<v1::ErrorGrid>(seen, Topic::ErrorGrid).empty());
  publisher_->model(active(2), kPublishTime, kWall);
  seen = far_->take();
  EXPECT_THAT(messages<v1::ErrorModel>(seen, Topic::ErrorModel), SizeIs(1));
  EXPECT_THAT(messages<v1::ModelState>(seen, Topic::ModelState), SizeIs(1));
}

TEST_F(PublisherTest, MessagesEncodedElsewhereGetSequenceNumbersOfThisPublisher) {
  publish_live(view(), active(), kPublishTime, kWall);  // has numbers already
  const auto before = taken<v1::Compensation>(Topic::Compensation).at(0).sequence_number();
  publisher_->model(active(), kPublishTime, kWall);
  const auto seen = far_->take();
  const auto models = messages<v1::ErrorModel>(seen, Topic::ErrorModel);
  ASSERT_THAT(models, SizeIs(1));
  EXPECT_EQ(models[0],
            model_message(kPublishedModel, {.machine = "mill", .sequence_number = before + 1}));
  auto expected = grid_messages(kPublishedModel, {.machine = "mill"});
  for (std::size_t i = 0; i < expected.size(); ++i) expected[i].sequence_number(before + 2 + i);
  EXPECT_EQ(messages<v1::ErrorGrid>(seen, Topic::ErrorGrid), expected);
}

TEST_F(PublisherTest, TheStateGoesOutEverySecondAndAtOnceWhenItChanges) {
  std::size_t sent = 0;
  for (auto t = 0ms; t <= 2500ms; t += 10ms) {
    publisher_->model({}, kPublishTime + t, kWall + t);
    sent += taken<v1::ModelState>(Topic::ModelState).size();
  }

  EXPECT_EQ(sent, 3u);
  auto state = active();
  state.reason = "forced by anna: crane test";
  publisher_->model(state, kPublishTime + 2510ms, kWall + 2510ms);
  const auto changed = taken<v1::ModelState>(Topic::ModelState);
  ASSERT_THAT(changed, SizeIs(1));
  EXPECT_EQ(changed[0].state(), ModelStatus::MODEL_ACTIVE);
  EXPECT_EQ(changed[0].reason(), "forced by anna: crane test");
}

TEST_F(PublisherTest, TheIdentityGoesOutBeforeEachStateAndAtOnceWhenItChanges) {
  publisher_->set_identity({.machine_id = "7c1d5a52-8f0d-4c0e-8d0d-2f6b3f1f0c11"});
  publisher_->model({}, kPublishTime, kWall);
  publisher_->set_identity(
      {.machine_id = "7c1d5a52-8f0d-4c0e-8d0d-2f6b3f1f0c11", .devices_simulated = true});
  publisher_->model({}, kPublishTime, kWall + 1ms);

  const auto seen = far_->take();
  const auto identities = messages<v1::Identity>(seen, Topic::Identity);
  const auto states = messages<v1::ModelState>(seen, Topic::ModelState);
  ASSERT_THAT(identities, SizeIs(2));
  ASSERT_THAT(states, SizeIs(2));
  EXPECT_LT(identities[0].sequence_number(), states[0].sequence_number());
  EXPECT_EQ(identities[0].machine_id(), "7c1d5a52-8f0d-4c0e-8d0d-2f6b3f1f0c11");
  EXPECT_FALSE(identities[0].twin());
  EXPECT_TRUE(identities[1].devices_simulated());
}

TEST_F(PublisherTest, ATwinThatAbbeDdsReportsIsPublishedUntilItIsGone) {
  for (const std::string seen : {"machine_id 4711", ""}) {
    far_->report_twin(seen);
    publisher_->beat(kWall);
    publisher_->model({}, kPublishTime, kWall);
    const auto sent = taken<v1::Identity>(Topic::Identity);
    ASSERT_THAT(sent, SizeIs(1));
    EXPECT_EQ(sent[0].twin(), !seen.empty());
    EXPECT_EQ(sent[0].twin_seen(), seen);
  }
}

TEST_F(PublisherTest, TheIdentitySaysWhetherTheModelWasMadeOnSimulatedDevices) {
  auto model = kPublishedModel;
  model.simulated = true;
  auto state = active();
  state.model = &model;
  publisher_->model(state, kPublishTime, kWall);
  const auto sent = taken<v1::Identity>(Topic::Identity);
  ASSERT_THAT(sent, SizeIs(1));
  EXPECT_EQ(sent[0].model_id(), "m");
  EXPECT_TRUE(sent[0].model_simulated());
}

TEST_F(PublisherTest, TheAgeOfAModelCountsFromItsActivation) {
  auto model = kPublishedModel;
  model.active_since = kPublishTime - 1h;
  auto state = active();
  state.model = &model;
  publisher_->model(state, kPublishTime, kWall);
  const auto sent = taken<v1::ModelState>(Topic::ModelState);
  ASSERT_THAT(sent, SizeIs(1));
  EXPECT_EQ(sent[0].age_ns(), std::chrono::nanoseconds{1h}.count());
}

TEST_F(PublisherTest, AMessageOutsideItsBoundsIsCountedAndNamed) {
  open({.machine = std::string(65, 'm')});
  publish_live(view(), active(), kPublishTime, kWall);
  EXPECT_EQ(publisher_->link().counters().refused, 2u);
  EXPECT_THAT(publisher_->refusal(), testing::HasSubstr("machine"));
}

TEST_F(PublisherTest, EveryStreamHasItsHealth) {
  std::vector<StreamHealth> streams(2);
  streams[0].status.name = "tracker";
  streams[1].status.name = "encoder";
  streams[1].status.last_fault = "no answer";
  publisher_->health(streams, kPublishTime);
  const auto sent = taken<v1::Health>(Topic::Health);
  ASSERT_THAT(sent, SizeIs(2));
  EXPECT_EQ(sent[1].stream(), "encoder");
  EXPECT_EQ(sent[1].fault(), "no answer");
  streams[1].status.condition = "X missing (node 1)";
  publisher_->health(streams, kPublishTime);
  EXPECT_EQ(taken<v1::Health>(Topic::Health).at(1).fault(),
            "X missing (node 1); last fault: no answer");
}

}  // namespace
}  // namespace abbe::daemon
