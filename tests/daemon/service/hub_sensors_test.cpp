/// A broken sensor of a scale, as seen by everybody who asks the daemon.
#include <gmock/gmock.h>

#include <cmath>

#include "config_tables.hpp"
#include "hub_bench.hpp"
#include "warm_scales.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using test::messages;
using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::StartsWith;

struct Rtd final : SampleSource {
  void drain(Batch& batch) override {
    batch = std::move(next);
    next.clear();
  }
  [[nodiscard]] std::vector<StreamHealth> health(protocol::HostTime) override {
    StreamHealth h;
    h.status.name = "rtd";
    h.status.connected = true;
    return {h};
  }
  Batch next;
};

class HubSensors : public test::HubBench<Rtd> {
 protected:
  HubSensors() {
    const auto config =
        parse_config(to_toml(config_tables::half_metre_mill()) + test::kWarmScales, "abbed.toml");
    EXPECT_TRUE(config) << config.error().details.front();
    config_ = *config;
    make_hub();
    auto kept = keep_a_model();
    EXPECT_TRUE(kept) << kept.error().text;
    authority_->set_active(std::move(kept->active).value());
  }
  /// One second: axes at 10 Hz and one reading of the sensor.
  void second(double scale_C) {
    protocol::EnvironmentSample s;
    s.head.time = time_.now() + 100ms;
    s.measured = protocol::temperature_bit(0);
    s.temperature_K[0] = scale_C + 273.15;
    devices_.next.measured_environment.push_back({0, s});
    for (int i = 0; i < 10; ++i) {
      protocol::AxisSample axes;
      axes.head.time = time_.now() + 100ms;
      axes.axis_count = 3;
      axes.missing_mask = without_reading_;
      axes.position = {0.1, 0.1, -0.1};
      devices_.next.axes.push_back(axes);
      cycle(100ms);
    }
  }
  std::uint8_t without_reading_ = 0;

  std::string health_of_rtd() {
    std::string fault = "(nothing)";
    for (const auto& m : messages<v1::Health>(far_->take(), Topic::Health))
      if (m.stream() == "rtd") fault = m.fault();
    return fault;
  }
  std::string reason_of_x() {
    return ask({{"do", "status"}})["axes"][0].value("missing", std::string{});
  }
};

TEST_F(HubSensors, ThatWorkAreNotMentioned) {
  for (int i = 0; i < 4; ++i) second(21.0);
  EXPECT_THAT(health_of_rtd(), IsEmpty());
  EXPECT_THAT(reason_of_x(), IsEmpty());
  EXPECT_EQ(hub_->model_state().status, v1::ModelStatus::MODEL_ACTIVE);
}

TEST_F(HubSensors, WithoutAValueGiveTheReasonToStatusHealthAndModel) {
  for (int i = 0; i < 4; ++i) second(21.0);
  for (int i = 0; i < 3; ++i) second(std::nan(""));
  const std::string text = "scale_x is not available (X is missing): rtd sends no value";
  EXPECT_THAT(health_of_rtd(), StartsWith(text));
  EXPECT_THAT(reason_of_x(), StartsWith(text));
  const auto state = hub_->model_state();
  EXPECT_EQ(state.status, v1::ModelStatus::MODEL_STALE);
  EXPECT_THAT(state.reason, AllOf(HasSubstr("no recent axis positions"), HasSubstr(text)));
  const auto status = ask({{"do", "status"}});
  EXPECT_TRUE(status["position_m"][0].is_null());
  EXPECT_THAT(status["streams"][0]["condition"].get<std::string>(), StartsWith(text));
}

TEST_F(HubSensors, AreNotTheReasonIfAReadingOfAnotherAxisIsMissing) {
  for (int i = 0; i < 4; ++i) second(21.0);
  without_reading_ = 0b010;
  for (int i = 0; i < 3; ++i) second(std::nan(""));
  EXPECT_THAT(hub_->model_state().reason,
              AllOf(StartsWith("no recent axis positions"), Not(HasSubstr("scale_x"))));
  EXPECT_THAT(reason_of_x(), StartsWith("scale_x is not available"));
}

TEST_F(HubSensors, ThatJumpAreHeldAndNamed) {
  for (int i = 0; i < 4; ++i) second(21.0);
  for (int i = 0; i < 3; ++i) second(85.0);
  EXPECT_THAT(health_of_rtd(),
              StartsWith("scale_x is not used (21.00 C is used for 60 s, then X is "
                         "missing): it reads 85.00 C, expected 0.00 to 50.00 C"));
  EXPECT_THAT(reason_of_x(), IsEmpty());
  EXPECT_EQ(hub_->model_state().status, v1::ModelStatus::MODEL_ACTIVE);
}

TEST_F(HubSensors, AreUsedAgainWhenAPersonAcceptsThem) {
  const auto accept = [&](const std::string& sensor, const std::string& why) {
    return ask({{"do", "sensors"}, {"accept", true}, {"sensor", sensor}, {"why", why}});
  };
  for (int i = 0; i < 4; ++i) second(21.0);
  EXPECT_THAT(accept("scale_x", "warm-up").dump(), HasSubstr("there is nothing to accept"));
  for (int i = 0; i < 300; ++i) second(24.0);
  EXPECT_THAT(reason_of_x(), HasSubstr("if it is right: abbe sensors accept scale_x --why"));
  EXPECT_THAT(accept("scale_x", "").dump(), HasSubstr("give the reason"));
  EXPECT_THAT(accept("scale_q", "warm-up").dump(), HasSubstr("known are scale_x"));
  EXPECT_TRUE(accept("scale_x", "compared with a thermometer")["ok"]);
  for (int i = 0; i < 3; ++i) second(24.0);
  EXPECT_THAT(reason_of_x(), IsEmpty());
  EXPECT_EQ(ask({{"do", "status"}})["streams"][0]["condition"], "");
}

TEST_F(HubSensors, AreAFaultWithItsTextAlsoForOneReading) {
  for (int i = 0; i < 4; ++i) second(21.0);
  second(30.0);
  for (int i = 0; i < 3; ++i) second(21.0);
  const auto rtd = ask({{"do", "status"}})["streams"][0];
  EXPECT_EQ(rtd["condition"], "");
  EXPECT_EQ(rtd["faults"], 1);
  EXPECT_THAT(rtd["last_fault"].get<std::string>(), HasSubstr("it jumped to 30.00 C"));
}

}  // namespace
}  // namespace abbe::daemon
