#include "abbe/service/hub.hpp"

#include <gmock/gmock.h>
#include <unistd.h>

#include <algorithm>
#include <future>

#include "hub_bench.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;
using protocol::HostTime;
using test::messages;
using test::myself;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::SizeIs;
using ::testing::StartsWith;
using v1::ModelStatus;

struct FakeDevices final : SampleSource {
  void drain(Batch& batch) override {
    batch = std::move(next);
    next.clear();
  }
  [[nodiscard]] std::vector<StreamHealth> health(HostTime) override {
    StreamHealth h;
    h.status.name = "encoder";
    h.latency.of_bucket[drivers::LatencyHistogram::bucket_of(1500ns)] = 7;
    return {h};
  }
  Batch next;
};

class HubTest : public test::HubBench<FakeDevices> {
 protected:
  HubTest() { make_hub(); }

  void activate_a_model() {
    auto kept = keep_a_model();
    ASSERT_TRUE(kept) << kept.error().text;
    authority_->set_active(std::move(kept->active).value());
  }
  void cycle_with_axes(std::chrono::nanoseconds later = 1ms) {
    protocol::AxisSample sample;
    sample.head.time = time_.now() + later;
    sample.axis_count = 3;
    sample.position = {0.01, -0.02, -0.25};
    devices_.next.axes.push_back(sample);
    cycle(later);
  }
  [[nodiscard]] std::vector<ModelStatus> states() {
    std::vector<ModelStatus> out;
    for (const auto& m : messages<v1::ModelState>(far_->take(), Topic::ModelState))
      out.push_back(m.state());
    return out;
  }
};

TEST_F(HubTest, SendsHeartbeatsWithAndWithoutInput) {
  std::size_t beats = 0;
  for (int i = 0; i < 10; ++i) {
    cycle(100ms);
    for (const auto& frame : far_->take()) beats += frame.kind == 0 ? 1 : 0;
  }
  EXPECT_EQ(beats, 10u);
  EXPECT_EQ(hub_->last_cycle(), time_.wall_now());
}

TEST_F(HubTest, SamplesOfTheDevicesArePublishedInTheSameCycle) {
  activate_a_model();
  cycle();  // lets abbe-dds in
  cycle_with_axes();
  const auto sent = messages<v1::Compensation>(far_->take(), Topic::Compensation);
  ASSERT_THAT(sent, SizeIs(1));
  EXPECT_EQ(sent[0].state(), ModelStatus::MODEL_ACTIVE);
  EXPECT_TRUE(sent[0].inside());
  EXPECT_EQ(sent[0].age_ns(), 0);
}

TEST_F(HubTest, AnEncoderThatFallsSilentMakesTheModelStaleAndItsReturnActiveAgain) {
  activate_a_model();
  cycle_with_axes();
  EXPECT_THAT(states(), testing::ElementsAre(ModelStatus::MODEL_ACTIVE));
  cycle(500ms);
  EXPECT_THAT(states(), SizeIs(0));
  cycle(1ms);
  EXPECT_THAT(states(), testing::ElementsAre(ModelStatus::MODEL_STALE));
  cycle_with_axes();
  EXPECT_THAT(states(), testing::ElementsAre(ModelStatus::MODEL_ACTIVE));
}

TEST_F(HubTest, ATrackerAloneDoesNotKeepTheModelActive) {
  activate_a_model();
  cycle_with_axes();
  for (int i = 0; i < 60; ++i) {
    protocol::TrackerPoint point;
    point.head.time = time_.now();
    devices_.next.points.push_back(point);
    cycle(10ms);
  }
  EXPECT_EQ(hub_->model_state().status, ModelStatus::MODEL_STALE);
}

TEST_F(HubTest, PublishesTheHealthOfTheStreamsOnceASecond) {
  std::vector<v1::Health> sent;
  for (int i = 0; i < 25; ++i) {
    cycle(100ms);
    const auto more = messages<v1::Health>(far_->take(), Topic::Health);
    sent.insert(sent.end(), more.begin(), more.end());
  }
  ASSERT_THAT(sent, SizeIs(3 * 4));  // in the first cycle and twice a second later
  EXPECT_EQ(sent[0].stream(), "encoder");
  EXPECT_EQ(sent[1].stream(), "models");
  EXPECT_EQ(sent[2].stream(), "dds");
  EXPECT_EQ(sent[3].stream(), "dds_security");
}

TEST_F(HubTest, RefusesToCalibrateAxesTheControlCorrectsAlready) {
  config_.of<EncoderConfig>().emplace().axes_compensated = true;
  const auto started =
      calibration_->start(OtfRequest{{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}}}, "anna", time_.now());
  ASSERT_FALSE(started);
  EXPECT_EQ(started.error().code, ErrorCode::Refused);
  EXPECT_THAT(started.error().text, testing::HasSubstr("axes_compensated"));
}

TEST_F(HubTest, RefusesToCalibrateOnTheFlyWithAStationaryTracker) {
  config_.of<TrackerConfig>().emplace().mode = TrackerModeConfig::Stationary;
  const auto started =
      calibration_->start(OtfRequest{{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}}}, "anna", time_.now());
  ASSERT_FALSE(started);
  EXPECT_EQ(started.error().code, ErrorCode::Refused);
  EXPECT_THAT(started.error().text, testing::HasSubstr("stationary"));
}

TEST_F(HubTest, StatusShowsNoPositionThatIsNotCurrent) {
  const auto positions = [this] { return ask({{"do", "status"}})["position_m"]; };
  cycle_with_axes();

  EXPECT_EQ(positions(), json({0.01, -0.02, -0.25}));
  protocol::AxisSample without_x;
  without_x.head.time = time_.now() + 1ms;
  without_x.head.flags = static_cast<protocol::SampleFlags>(protocol::SampleFlag::AxisMissing);
  without_x.axis_count = 3;
  without_x.missing_mask = 0b001;
  without_x.position = {0.01, -0.02, -0.25};
  devices_.next.axes.push_back(without_x);
  cycle();
  EXPECT_EQ(positions(), json({nullptr, -0.02, -0.25}));
  cycle(600ms);
  EXPECT_EQ(positions(), json({nullptr, nullptr, nullptr}))
      << "no sample for longer than the axes are known";
}

TEST_F(HubTest, StatusNamesTheAxesOfItsPositions) {
  for (const std::string name : {"X", "Y", "Z"}) config_.machine.axes.push_back({.name = name});
  cycle_with_axes();
  const json status = ask({{"do", "status"}});
  ASSERT_EQ(status["axes"].size(), status["position_m"].size());
  EXPECT_EQ(status["axes"][0], json({{"axis", "X"}, {"kind", "linear"}}));
}

TEST_F(HubTest, StatusHasTheLatencyHistogramOfADevice) {
  cycle();
  const json status = ask({{"do", "status"}});
  const json& stream = status["streams"][0];
  ASSERT_EQ(stream["name"], "encoder");
  ASSERT_EQ(stream["latency_counts"].size(), 1u);
  EXPECT_GT(stream["latency_counts"][0][0].get<double>(), 1.5e-6);
  EXPECT_LT(stream["latency_counts"][0][0].get<double>(), 1.25 * 1.5e-6);
  EXPECT_EQ(stream["latency_counts"][0][1], 7);
}

TEST_F(HubTest, RunsATaskOfAnotherThreadInItsNextCycle) {
  auto answer = std::async(std::launch::async, [this] {
    return hub_->call([] { return json{{"n", 3}}; }, 60s);
  });
  while (answer.wait_for(0s) != std::future_status::ready) hub_->cycle(time_.wall_now());
  EXPECT_EQ(answer.get(), (json{{"n", 3}}));
}

TEST_F(HubTest, ATaskWhoseCallerTimedOutDoesNotRun) {
  bool ran = false;
  const auto answer = hub_->call(
      [&ran] {
        ran = true;
        return json{};
      },
      1ms);
  EXPECT_FALSE(answer);
  cycle();
  EXPECT_FALSE(ran);
}

TEST_F(HubTest, AnExceptionOfATaskIsRethrownInTheCallingThread) {
  auto answer = std::async(std::launch::async, [this] {
    return hub_->call([]() -> json { throw std::runtime_error{"no"}; }, 60s);
  });
  while (answer.wait_for(0s) != std::future_status::ready) hub_->cycle(time_.wall_now());
  EXPECT_THROW((void)answer.get(), std::runtime_error);
  cycle();
}

TEST_F(HubTest, ARequestIsRefusedWithoutItsRole) {
  config_.control = {.look_group = "abbe-no-such-look",
                     .change_group = "abbe-no-such-change",
                     .move_group = "abbe-no-such-move"};
  const ControlPeer stranger{.user = "anna", .uid = ::geteuid() + 1};

  for (const ControlVerb& verb : control_verbs()) {
    json request{{"do", verb.name}};
    if (!verb.member.empty()) request[verb.member] = true;
    const json answer = answer_request(*hub_, request, stranger, 0ms);
    EXPECT_EQ(answer["code"], "refused") << request;
    const std::string role = verb.role == Role::Move     ? "move"
                             : verb.role == Role::Change ? "change"
                                                         : "look";
    EXPECT_THAT(
        answer["error"].get<std::string>(),
        AllOf(StartsWith(verb.name + ": "), HasSubstr("anna"), HasSubstr("abbe-no-such-" + role)));
  }
}

TEST_F(HubTest, MotionAndModelChangesAreRefusedToTheLookRole) {
  const auto role_of = [](const std::string& name, const std::string& member) {
    const auto verbs = control_verbs();
    const auto found = std::ranges::find_if(
        verbs, [&](const ControlVerb& v) { return v.name == name && v.member == member; });
    return found == verbs.end() ? Role::Look : found->role;
  };

  EXPECT_EQ(role_of("touch", ""), Role::Move);
  EXPECT_EQ(role_of("touches", ""), Role::Move);
  EXPECT_EQ(role_of("touch", "cancel"), Role::Look);
  EXPECT_EQ(role_of("calibrate", ""), Role::Change);
  EXPECT_EQ(role_of("cancel", ""), Role::Change);
  EXPECT_EQ(role_of("activate", ""), Role::Change);
  EXPECT_EQ(role_of("add", ""), Role::Change);
  EXPECT_EQ(role_of("rollback", ""), Role::Change);
  EXPECT_EQ(role_of("change", ""), Role::Look);
  EXPECT_EQ(role_of("reference", "here"), Role::Change);
  EXPECT_EQ(role_of("tracker", ""), Role::Move);
}

TEST_F(HubTest, TrackerMotionOrdersAreRefusedToTheLookRole) {
  config_.control = {.change_group = "abbe-no-such-change", .move_group = "abbe-no-such-move"};
  const ControlPeer looks{.user = "anna", .uid = ::geteuid() + 1};
  for (const char* order : {"initialize", "home", "find", "reflector set"}) {
    const json answer = answer_on_hub(*hub_, {{"do", "tracker"}, {"order", order}}, looks);
    EXPECT_THAT(answer["error"].get<std::string>(),
                HasSubstr("moves a machine or tracker, which anna may not"));
  }
  EXPECT_THAT(
      answer_on_hub(*hub_, {{"do", "tracker_reflectors"}}, looks)["error"].get<std::string>(),
      HasSubstr("not in this daemon"));
}

// The hub compares each name with the axes: 600,000 names kept it busy for seconds.
TEST_F(HubTest, MoreAxisNamesThanACardCountsAreRefusedBeforeTheHub) {
  const auto asked = [&](std::size_t names) {
    return answer_on_hub(
        *hub_,
        {{"do", "reference"}, {"here", true}, {"axes", std::vector<std::string>(names, "X")}},
        myself());
  };
  const json many = asked(600'000);
  EXPECT_EQ(many["code"], "usage");
  EXPECT_THAT(many["error"].get<std::string>(), HasSubstr("600000 axes are named: at most 8"));
  EXPECT_THAT(asked(8)["error"].get<std::string>(), HasSubstr("not in this daemon"));
}

TEST_F(HubTest, TheUserOfAbbeDdsHasNoRole) {
  Hub hub{HubParts{.config = config_,
                   .time = time_,
                   .devices = devices_,
                   .authority = *authority_,
                   .calibration = *calibration_,
                   .network_user = ::geteuid() + 7}};
  const auto answer_to = [&](uid_t uid) {
    return answer_on_hub(hub, {{"do", "calibration"}}, {.user = "abbe-dds", .uid = uid});
  };
  EXPECT_THAT(answer_to(::geteuid() + 7)["error"].get<std::string>(),
              HasSubstr("abbe-dds is the user of abbe-dds, which reads the network"));
  EXPECT_EQ(answer_to(::geteuid())["ok"], true);
}

TEST_F(HubTest, CollectsStandstillsRequestedOverTheSocket) {
  config_.of<TrackerConfig>().emplace().host = "127.0.0.1";
  VerificationService verification{config_};
  Hub hub{HubParts{.config = config_,
                   .time = time_,
                   .devices = devices_,
                   .authority = *authority_,
                   .calibration = *calibration_,
                   .verification = &verification}};

  const auto ask = [&](const json& request) {
    auto answer =
        std::async(std::launch::async, [&] { return answer_request(hub, request, myself(), 60s); });
    while (answer.wait_for(0s) != std::future_status::ready) hub.cycle(time_.wall_now());
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
      hub.cycle(time_.wall_now());
    }
  };

  config_.machine.name = "small mill";
  const auto begun = ask({{"do", "verification"}, {"step", "begin"}});
  ASSERT_EQ(begun["ok"], true) << begun.dump();
  EXPECT_EQ(begun["machine"], "small mill");
  stand(0.1);
  stand(0.2);
  const auto look =
      ask({{"do", "verification"}, {"step", "look"}, {"number", begun["number"]}, {"from", 0}});
  ASSERT_EQ(look["points"].size(), 1u) << look.dump();
  EXPECT_EQ(look["points"][0]["reading_m"], (json{0.1, 0.0, 0.0}));
  EXPECT_EQ(look["points"][0]["tracker_m"], (json{1.0, 0.1, 0.0}));
  EXPECT_GT(look["standing"].get<int>(), 50);
  const auto end =
      ask({{"do", "verification"}, {"step", "end"}, {"number", begun["number"]}, {"from", 1}});
  ASSERT_EQ(end["points"].size(), 1u) << end.dump();
  EXPECT_EQ(end["points"][0]["reading_m"], (json{0.2, 0.0, 0.0}));
  EXPECT_EQ(ask({{"do", "verification"}, {"step", "look"}, {"number", 99}})["code"], "refused");
}

}  // namespace
}  // namespace abbe::daemon
