#include "abbe/daemon/hub.hpp"

#include <gmock/gmock.h>
#include <stdlib.h>

#include <future>

#include "abbe/daemon/control_api.hpp"
#include "dds_far_end.hpp"
#include "synthetic_model.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;
using protocol::HostTime;
using test::FarEnd;
using test::messages;
using ::testing::SizeIs;
using v1::ModelStatus;

/// Host and wall time as one, moved by the test.
class OneClock final : public drivers::TimeSource {
 public:
  [[nodiscard]] HostTime now() const noexcept override { return HostTime{100s} + passed; }
  [[nodiscard]] std::chrono::nanoseconds wall(std::chrono::nanoseconds host) const noexcept override {
    return host;
  }
  [[nodiscard]] std::chrono::nanoseconds host(std::chrono::nanoseconds wall) const noexcept override {
    return wall;
  }
  [[nodiscard]] Hub::WallTime wall_now() const { return Hub::WallTime{100s} + passed; }
  std::chrono::nanoseconds passed{};
};

struct FakeDevices final : SampleSource {
  void drain(Batch& batch) override {
    batch = std::move(next);
    next.clear();
  }
  [[nodiscard]] std::vector<StreamHealth> health(HostTime) override {
    StreamHealth h;
    h.status.name = "encoder";
    return {h};
  }
  Batch next;
};

class HubTest : public ::testing::Test {
 protected:
  HubTest() {
    std::string name = testing::TempDir() + "abbe-hub-XXXXXX";
    directory_ = ::mkdtemp(name.data());
    config_.machine.name = "mill";
    config_.machine.target_offset_m = {0.02, -0.015, -0.12};
    authority_.emplace(ModelAuthority::open(directory_, config_, {}, time_.now()).value());
    calibration_.emplace(config_, *authority_, nullptr, protocol::UtcOffset{});
    publisher_.emplace(
        DdsLink::listen(directory_ / "dds.sock").value(),
        PublisherOptions{
            .machine = "mill", .tool_offset_m = config_.machine.target_offset_m, .compensation_hz = 0.0},
        protocol::UtcOffset{});
    far_.emplace(directory_ / "dds.sock");
    hub_.emplace(HubParts{.config = config_,
                          .time = time_,
                          .devices = devices_,
                          .authority = *authority_,
                          .calibration = *calibration_,
                          .publisher = &*publisher_});
  }
  ~HubTest() override { std::filesystem::remove_all(directory_); }

  void activate_a_model() {
    auto document = test::synthetic_document(1);
    document.machine_hash = machine_hash(config_);
    auto kept = authority_->keeper().keep(document, {.accepted = true}, {"anna", "test", {}}, time_.now());
    ASSERT_TRUE(kept) << kept.error().text;
    authority_->take_up(std::move(kept->active).value());
  }
  void turn(std::chrono::nanoseconds later = 1ms) {
    time_.passed += later;
    hub_->turn(time_.wall_now());
  }
  void turn_with_axes(std::chrono::nanoseconds later = 1ms) {
    protocol::AxisSample sample;
    sample.head.time = time_.now() + later;
    sample.axis_count = 3;
    sample.position = {0.01, -0.02, -0.25};
    devices_.next.axes.push_back(sample);
    turn(later);
  }
  [[nodiscard]] std::vector<ModelStatus> states() {
    std::vector<ModelStatus> out;
    for (const auto& m : messages<v1::ModelState>(far_->take(), Topic::ModelState)) out.push_back(m.state());
    return out;
  }

  OneClock time_;
  Config config_;
  FakeDevices devices_;
  std::filesystem::path directory_;
  std::optional<ModelAuthority> authority_;
  std::optional<CalibrationService> calibration_;
  std::optional<Publisher> publisher_;
  std::optional<FarEnd> far_;
  std::optional<Hub> hub_;
};

TEST_F(HubTest, SaysThatItIsAliveWhetherOrNotAnythingComes) {
  std::size_t beats = 0;
  for (int i = 0; i < 10; ++i) {
    turn(100ms);
    for (const auto& frame : far_->take()) beats += frame.kind == 0 ? 1 : 0;
  }
  EXPECT_EQ(beats, 10u);
  EXPECT_EQ(hub_->last_turn(), time_.wall_now());
}

TEST_F(HubTest, WhatTheDevicesBringGoesOutInTheSameTurn) {
  activate_a_model();
  turn();  // lets abbe-dds in
  turn_with_axes();
  const auto sent = messages<v1::Compensation>(far_->take(), Topic::Compensation);
  ASSERT_THAT(sent, SizeIs(1));
  EXPECT_EQ(sent[0].state(), ModelStatus::MODEL_ACTIVE);
  EXPECT_TRUE(sent[0].inside());
  EXPECT_EQ(sent[0].age_ns(), 0);
}

TEST_F(HubTest, AnEncoderThatFallsSilentMakesTheModelStaleAndItsReturnActiveAgain) {
  activate_a_model();
  turn_with_axes();
  EXPECT_THAT(states(), testing::ElementsAre(ModelStatus::MODEL_ACTIVE));
  turn(500ms);
  EXPECT_THAT(states(), SizeIs(0));
  turn(1ms);
  EXPECT_THAT(states(), testing::ElementsAre(ModelStatus::MODEL_STALE));
  turn_with_axes();
  EXPECT_THAT(states(), testing::ElementsAre(ModelStatus::MODEL_ACTIVE));
}

TEST_F(HubTest, ATrackerAloneDoesNotKeepTheModelActive) {
  activate_a_model();
  turn_with_axes();
  for (int i = 0; i < 60; ++i) {
    protocol::TrackerPoint point;
    point.head.time = time_.now();
    devices_.next.points.push_back(point);
    turn(10ms);
  }
  EXPECT_EQ(hub_->standing().status, ModelStatus::MODEL_STALE);
}

TEST_F(HubTest, SaysHowTheStreamsAreOnceASecond) {
  std::vector<v1::Health> sent;
  for (int i = 0; i < 25; ++i) {
    turn(100ms);
    const auto more = messages<v1::Health>(far_->take(), Topic::Health);
    sent.insert(sent.end(), more.begin(), more.end());
  }
  ASSERT_THAT(sent, SizeIs(3 * 3));  // at the first turn and twice a second later
  EXPECT_EQ(sent[0].stream(), "encoder");
  EXPECT_EQ(sent[1].stream(), "models");
  EXPECT_EQ(sent[2].stream(), "dds");
}

TEST_F(HubTest, RefusesToCalibrateAxesTheControlCorrectsAlready) {
  config_.encoder.emplace().axes_compensated = true;
  const auto started =
      calibration_->start(OtfRequest{{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}}}, "anna", time_.now());
  ASSERT_FALSE(started);
  EXPECT_EQ(started.error().code, ErrorCode::Refused);
  EXPECT_THAT(started.error().text, testing::HasSubstr("axes_compensated"));
}

TEST_F(HubTest, RefusesToCalibrateOnTheFlyWithAStationaryTracker) {
  config_.tracker.emplace().mode = TrackerModeConfig::Stationary;
  const auto started =
      calibration_->start(OtfRequest{{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}}}, "anna", time_.now());
  ASSERT_FALSE(started);
  EXPECT_EQ(started.error().code, ErrorCode::Refused);
  EXPECT_THAT(started.error().text, testing::HasSubstr("stationary"));
}

TEST_F(HubTest, RunsATaskOfAnotherThreadAtItsNextTurn) {
  auto answer = std::async(std::launch::async, [this] {
    return hub_->call([] { return json{{"n", 3}}; }, 60s);
  });
  while (answer.wait_for(0s) != std::future_status::ready) hub_->turn(time_.wall_now());
  EXPECT_EQ(answer.get(), (json{{"n", 3}}));
}

TEST_F(HubTest, ATaskNobodyWaitsForAnyMoreDoesNotRun) {
  bool ran = false;
  const auto answer = hub_->call(
      [&ran] {
        ran = true;
        return json{};
      },
      1ms);
  EXPECT_FALSE(answer);
  turn();
  EXPECT_FALSE(ran);
}

TEST_F(HubTest, ATaskThatThrowsThrowsInTheThreadThatAsked) {
  auto answer = std::async(std::launch::async, [this] {
    return hub_->call([]() -> json { throw std::runtime_error{"no"}; }, 60s);
  });
  while (answer.wait_for(0s) != std::future_status::ready) hub_->turn(time_.wall_now());
  EXPECT_THROW((void)answer.get(), std::runtime_error);
  turn();
}

TEST_F(HubTest, CollectsStandstillsForWhoeverAsksOverTheSocket) {
  config_.tracker.emplace().host = "127.0.0.1";
  VerificationService verification{config_};
  Hub hub{HubParts{.config = config_,
                   .time = time_,
                   .devices = devices_,
                   .authority = *authority_,
                   .calibration = *calibration_,
                   .verification = &verification}};
  const auto ask = [&](const json& request) {
    auto answer = std::async(std::launch::async, [&] { return answer_request(hub, request, 60s); });
    while (answer.wait_for(0s) != std::future_status::ready) hub.turn(time_.wall_now());
    return answer.get();
  };
  const auto stand = [&](double x) {
    for (int i = 0; i < 1500; ++i) {
      protocol::AxisSample axes;
      axes.head.time = time_.now() + 2ms;
      axes.axis_count = 3;
      axes.position = {x, 0.0, 0.0};
      devices_.next.axes.push_back(axes);
      if (i % 10 == 5) {
        auto& point = devices_.next.points.emplace_back();
        point.head.time = time_.now() + 1ms;
        point.p_tracker_m = {1.0, x, 0.0};
      }
      time_.passed += 2ms;
      hub.turn(time_.wall_now());
    }
  };
  const auto begun = ask({{"do", "verification"}, {"step", "begin"}});
  ASSERT_EQ(begun["ok"], true) << begun.dump();
  stand(0.1);
  stand(0.2);
  const auto look = ask({{"do", "verification"}, {"step", "look"}, {"number", begun["number"]}, {"from", 0}});
  ASSERT_EQ(look["points"].size(), 1u) << look.dump();
  EXPECT_EQ(look["points"][0]["reading_m"], (json{0.1, 0.0, 0.0}));
  EXPECT_EQ(look["points"][0]["tracker_m"], (json{1.0, 0.1, 0.0}));
  EXPECT_GT(look["standing"].get<int>(), 50);
  const auto end = ask({{"do", "verification"}, {"step", "end"}, {"number", begun["number"]}, {"from", 1}});
  ASSERT_EQ(end["points"].size(), 1u) << end.dump();
  EXPECT_EQ(end["points"][0]["reading_m"], (json{0.2, 0.0, 0.0}));
  EXPECT_EQ(ask({{"do", "verification"}, {"step", "look"}, {"number", 99}})["code"], "refused");
}

}  // namespace
}  // namespace abbe::daemon
