/// From the readings of sensors to the values that are used, with the limits of a configuration.
#include "abbe/pipeline/sensor_checks.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "abbe/pipeline/environment_use.hpp"
#include "abbe/pipeline/sensor_state_file.hpp"
#include "config_tables.hpp"
#include "warm_scales.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using calib::SensorDoubt;
using protocol::EnvironmentSample;
using protocol::HostTime;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

constexpr double kIce_K = 273.15;
constexpr HostTime kChecksStart{1000s};

/// The scale of X has the sensors scale_x and beside; coolant corrects nothing.
Config config_with_sensors(const std::string& more = {}) {
  std::string text = to_toml(config_tables::half_metre_mill()) + test::kWarmScales + more;
  const std::string inputs = "inputs = [\"scale_x\"]";
  text.replace(text.find(inputs), inputs.size(), "inputs = [\"scale_x\", \"beside\", \"coolant\"]");
  const auto config = parse_config(text, "abbed.toml");
  EXPECT_TRUE(config) << config.error().details.front();
  return config ? *config : Config{};
}

class SensorChecksTest : public testing::Test {
 protected:
  void start(const std::string& more = {}) {
    checks_.emplace(sensor_check_options(config_with_sensors(more)));
  }
  /// One sample a second; NaN: the device reports no value.
  CheckedEnvironment read(double scale_x_C, double beside_C = 21.0, double coolant_C = 30.0) {
    EnvironmentSample s;
    s.head.time = now_ += 1s;
    for (std::size_t i = 0; i < 3; ++i) s.measured |= protocol::temperature_bit(i);
    s.temperature_K[0] = scale_x_C + kIce_K;
    s.temperature_K[1] = beside_C + kIce_K;
    s.temperature_K[2] = coolant_C + kIce_K;
    return checks_->checked(s, protocol::temperature_bit(0) | protocol::temperature_bit(1) |
                                   protocol::temperature_bit(2));
  }
  double used_C(double scale_x_C, double beside_C = 21.0) {
    return read(scale_x_C, beside_C).sample.temperature_K[0] - kIce_K;
  }
  void settle(double scale_x_C = 21.0, double beside_C = 21.0) {
    for (int i = 0; i < 3; ++i) (void)read(scale_x_C, beside_C);
  }

  /// scale_x drifts to 22 C, by more than kTwin allows.
  void drift_apart() {
    for (int s = 1; s <= 50; ++s) (void)read(21.0 + 0.02 * s, 21.0);
  }

  std::optional<SensorChecks> checks_;
  HostTime now_ = kChecksStart;
};

TEST_F(SensorChecksTest, UseAReadingFromTheSecondOneOn) {
  start();
  EXPECT_TRUE(std::isnan(used_C(21.3)));
  EXPECT_NEAR(used_C(21.3), 21.3, 1e-9);
  EXPECT_THAT(checks_->findings(), IsEmpty());
}

TEST_F(SensorChecksTest, HoldTheLastGoodValueForAMinuteThenHaveNone) {
  start();
  settle();
  for (int s = 1; s <= 60; ++s) EXPECT_NEAR(used_C(85.0), 21.0, 1e-9) << s;
  EXPECT_TRUE(std::isnan(used_C(85.0)));
  EXPECT_NEAR(used_C(21.1), 21.1, 1e-9) << "back again";
}

TEST_F(SensorChecksTest, NameSensorValueExpectationAndRemedy) {
  start();
  settle();
  (void)read(24.0);
  ASSERT_THAT(checks_->findings(), SizeIs(1));
  const auto held = checks_->findings()[0];
  EXPECT_EQ(held.sensor, "scale_x");
  EXPECT_EQ(held.device, "rtd");
  EXPECT_THAT(held.axes, testing::ElementsAre("X"));
  EXPECT_THAT(held.text,
              HasSubstr("scale_x is not used (21.00 C is used for 60 s, then X is missing)"
                        ": it jumped to 24.00 C, expected 20.47 to 21.53 C; check"));
  for (int s = 0; s < 60; ++s) (void)read(24.0 + 0.01 * s);
  EXPECT_THAT(checks_->findings()[0].text,
              HasSubstr("scale_x is not available (X is missing): it jumped to 24.00 C"));
}

TEST_F(SensorChecksTest, BelieveADeviceThatReportsNoValueAtOnce) {
  start();
  settle();
  EXPECT_TRUE(std::isnan(used_C(std::nan(""))));
  EXPECT_EQ(checks_->findings()[0].text,
            "scale_x is not available (X is missing): rtd sends no value; check the sensor and its "
            "cable");
}

TEST_F(SensorChecksTest, CountAndKeepADoubtOfASingleReading) {
  start();
  settle();
  (void)read(44.0);
  (void)read(21.0);
  EXPECT_THAT(checks_->findings(), IsEmpty());
  ASSERT_THAT(checks_->doubts(), SizeIs(1));
  EXPECT_EQ(checks_->doubts()[0].count, 1u);
  EXPECT_THAT(checks_->doubts()[0].latest_text, HasSubstr("it jumped to 44.00 C"));
}

TEST_F(SensorChecksTest, RefuseAFirstReadingFarFromTheOtherScalesAndTheAir) {
  start(R"([[thermal]]
axis = "Y"
temperature = "beside"
alpha_um_per_m_K = 8
u_alpha_um_per_m_K = 0.5
u_temperature_K = 0.2
fixed_mm = 0
)");
  for (int i = 0; i < 5; ++i) (void)read(std::nan(""), 21.0);
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(std::isnan(used_C(41.0, 21.0)));
  EXPECT_EQ(checks_->findings()[0].doubt, SensorDoubt::Others);
  EXPECT_THAT(checks_->findings()[0].text,
              HasSubstr("expected 6.00 to 36.00 C as the scales, the air"));
}

constexpr const char* kTwin = R"([[sensors.limit]]
name = "scale_x"
twin = "beside"
max_twin_difference_K = 0.8
)";

TEST_F(SensorChecksTest, DoubtBothTwinsWhileTheyDiffer) {
  start(kTwin);
  settle(21.0, 21.3);
  double drifted_C = 21.0;
  for (int s = 0; s < 600 && checks_->findings().empty(); ++s) (void)read(drifted_C += 0.001, 20.7);
  EXPECT_NEAR(drifted_C, 21.5, 0.01);
  ASSERT_THAT(checks_->findings(), SizeIs(2));
  EXPECT_THAT(checks_->findings()[0].text, HasSubstr("as its twin beside; check both"));
  EXPECT_THAT(checks_->findings()[1].text, HasSubstr("as its twin scale_x; check both"));
  (void)read(21.0, 20.8);
  EXPECT_THAT(checks_->findings(), IsEmpty());
}

TEST_F(SensorChecksTest, CompareTwinsAtTheFirstReadingToo) {
  start(kTwin);
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(i < 2 || std::isnan(used_C(24.0, 21.0))) << i;
  EXPECT_EQ(checks_->findings()[0].doubt, SensorDoubt::Twin);
}

TEST_F(SensorChecksTest, KeepTheDoubtOfATwinWhileTheOtherIsSilent) {
  start(kTwin);
  settle();
  drift_apart();
  ASSERT_THAT(checks_->findings(), SizeIs(2));
  for (int s = 0; s < 5; ++s) (void)read(22.0, std::nan(""));
  ASSERT_THAT(checks_->findings(), SizeIs(2));
  EXPECT_EQ(checks_->findings()[0].doubt, SensorDoubt::Twin);
  EXPECT_EQ(checks_->findings()[1].doubt, SensorDoubt::NoValue);
  (void)read(22.0, 21.4);
  EXPECT_THAT(checks_->findings(), IsEmpty()) << "they agree again";
}

TEST_F(SensorChecksTest, KeepTheDoubtOfATwinThatWasSilentItself) {
  start(kTwin);
  settle();
  drift_apart();
  (void)read(std::nan(""), std::nan(""));
  (void)read(22.0, std::nan(""));
  EXPECT_EQ(checks_->findings().at(0).doubt, SensorDoubt::Twin);
}

TEST_F(SensorChecksTest, TakeLimitsFromTheConfiguration) {
  start(R"([[sensors.limit]]
name = "coolant"
expected_C = [10, 40]
max_rate_K_per_min = 60
tolerance_K = 2
)");
  for (const double coolant_C : {20.0, 20.0, 22.5}) (void)read(21, 21, coolant_C);
  EXPECT_THAT(checks_->findings(), IsEmpty());
  (void)read(21, 21, 41.0);
  EXPECT_EQ(checks_->findings().at(0).doubt, SensorDoubt::OutOfRange);
}

TEST_F(SensorChecksTest, GoOnFromAStateLikeTheChecksThatMadeIt) {
  start(kTwin);
  settle();
  for (const double C : {21.1, 24.0, 24.0}) (void)read(C);
  SensorChecks further{sensor_check_options(config_with_sensors(kTwin))};
  ASSERT_TRUE(further.go_on(checks_->to_attachment()));
  for (const double C : {24.0, 21.7, 21.2, 21.9, std::nan(""), 21.3}) {
    EnvironmentSample s;
    s.head.time = now_ + 1s;
    s.temperature_K[0] = C + kIce_K;
    s.temperature_K[1] = 21.0 + kIce_K;
    s.temperature_K[2] = 30.0 + kIce_K;
    const auto mask = further.mask_of("rtd");
    const auto live = read(C);
    const auto again = further.checked(s, mask);
    EXPECT_EQ(std::isnan(live.sample.temperature_K[0]), std::isnan(again.sample.temperature_K[0]));
    if (!std::isnan(C)) EXPECT_EQ(live.sample.temperature_K[0], again.sample.temperature_K[0]) << C;
    if (!std::isnan(live.sample.temperature_K[0]))
      EXPECT_EQ(checks_->applied(live, 0, now_ + 700ms), further.applied(again, 0, now_ + 700ms));
  }
}

TEST_F(SensorChecksTest, BeginAnewWhenAPersonAcceptsASensor) {
  start();
  settle();
  for (int s = 0; s < 600; ++s) (void)read(24.0);
  EXPECT_EQ(checks_->findings().at(0).doubt, SensorDoubt::Jump);
  ASSERT_TRUE(checks_->check_acceptance("scale_x"));
  checks_->accept("scale_x");
  EXPECT_TRUE(std::isnan(used_C(24.0)));
  EXPECT_NEAR(used_C(24.0), 24.0, 1e-9);
  EXPECT_THAT(checks_->findings(), IsEmpty());
  EXPECT_EQ(checks_->check_acceptance("scale_x").error().code, ErrorCode::Refused) << "in use";
  EXPECT_EQ(checks_->check_acceptance("scale_q").error().code, ErrorCode::Usage);
}

TEST_F(SensorChecksTest, AcceptOneOfATwinOnlyIfTheOtherIsSilent) {
  start(kTwin);
  settle();
  drift_apart();
  EXPECT_THAT(checks_->check_acceptance("scale_x").error().text, HasSubstr("still differ"));
  (void)read(22.0, std::nan(""));
  ASSERT_TRUE(checks_->check_acceptance("scale_x"));
  checks_->accept("scale_x");
  (void)read(22.0, std::nan(""));
  EXPECT_NEAR(used_C(22.0, std::nan("")), 22.0, 1e-9);
}

/// As a module that is dead: its device sends no sample at all.
TEST_F(SensorChecksTest, AcceptOneOfATwinWhoseOtherSendsNothing) {
  start(kTwin);
  settle();
  drift_apart();
  const auto read_alone = [this](double scale_x_C) {
    EnvironmentSample s;
    s.head.time = now_ += 1s;
    s.temperature_K[0] = scale_x_C + kIce_K;
    return checks_->checked(s, protocol::temperature_bit(0)).sample.temperature_K[0] - kIce_K;
  };
  for (int i = 0; i < 50; ++i) (void)read_alone(22.0);
  EXPECT_THAT(checks_->check_acceptance("scale_x").error().text, HasSubstr("still differ"));
  for (int i = 0; i < 20; ++i) (void)read_alone(22.0);
  ASSERT_TRUE(checks_->check_acceptance("scale_x"));
  checks_->accept("scale_x");
  (void)read_alone(22.0);
  EXPECT_NEAR(read_alone(22.0), 22.0, 1e-9);
}

TEST_F(SensorChecksTest, DoNotDoubtATwinThatIsNoTwinAnyMoreAfterARestart) {
  start(kTwin);
  settle();
  drift_apart();
  ASSERT_THAT(checks_->findings(), SizeIs(2));
  const auto left = checks_->to_attachment();
  start();  // the person has removed `twin`
  ASSERT_TRUE(checks_->go_on(left));
  EXPECT_THAT(checks_->findings(), IsEmpty());
  EXPECT_NEAR(used_C(22.0), 22.0, 1e-9);
}

TEST_F(SensorChecksTest, KnowTheirDoubtsAfterARestart) {
  using std::chrono::hours;
  start();
  settle();
  for (int s = 0; s < 300; ++s) (void)read(24.0);
  const std::string before = checks_->findings().at(0).text;
  const auto text = sensor_state_text(*checks_, {.host = now_, .utc = hours{9}});
  const auto options = sensor_check_options(config_with_sensors());
  const auto restarted_after = [&](std::chrono::nanoseconds off) {
    now_ = HostTime{30s};  // of a computer that was started again
    const auto left = left_sensor_state(text, options, {.host = now_, .utc = hours{9} + off});
    EXPECT_TRUE(left) << left.error().text;
    start();
    EXPECT_TRUE(checks_->go_on(*left));
  };
  restarted_after(20s);
  EXPECT_EQ(checks_->findings().at(0).text, before);
  for (int s = 0; s < 5; ++s) EXPECT_TRUE(std::isnan(used_C(24.0))) << s;
  restarted_after(-1h);
  EXPECT_TRUE(std::isnan(used_C(24.0))) << "the clock was set back";
  restarted_after(1h);
  (void)read(24.0);
  EXPECT_NEAR(used_C(24.0), 24.0, 1e-9) << "as after an hour without a reading";
}

TEST_F(SensorChecksTest, RefuseALeftStateThatIsDamaged) {
  start();
  auto text = sensor_state_text(*checks_, {});
  text[text.find("scale_x")] = 'S';
  EXPECT_FALSE(left_sensor_state(text, sensor_check_options(config_with_sensors()), {}));
}

TEST_F(SensorChecksTest, RefuseAStateThatCannotBeRead) {
  start();
  const RecordingAttachment torn{std::string{kSensorStateName}, "application/json",
                                 "[{\"sensor\":"};
  EXPECT_FALSE(checks_->go_on(torn));
}

TEST(AppliedTemperature, FollowsAtTheConfiguredRate) {
  const auto config = config_with_sensors("[sensors]\ncorrection_K_per_min = 0.6\n");
  EnvironmentMerge merge{environment_use(config), 600ms};
  HostTime t = kChecksStart;
  const auto read = [&](double C) {
    EnvironmentSample s;
    s.head.time = t;
    s.measured = protocol::temperature_bit(0);
    s.temperature_K[0] = C + kIce_K;
    Batch batch;
    batch.measured_environment = {{0, s}};
    merge.take(batch);
    t += 1s;
  };
  for (int i = 0; i < 3; ++i) read(21.0);
  for (int i = 0; i < 30; ++i) read(21.4);
  const HostTime stepped = kChecksStart + 3s;
  const auto applied_C = [&](HostTime at) {
    return merge.at(at + 600ms)->temperature_K[0] - kIce_K;
  };
  EXPECT_NEAR(applied_C(stepped), 21.0, 1e-9);
  EXPECT_NEAR(applied_C(stepped + 500ms), 21.005, 1e-9);
  EXPECT_NEAR(applied_C(stepped + 20s), 21.2, 1e-9);
}

TEST(Sensors, AreNotCheckedIfTheConfigurationSaysSo) {
  EXPECT_THAT(sensor_check_options(config_with_sensors("[sensors]\ncheck = false\n")).sensors,
              IsEmpty());
}

}  // namespace
}  // namespace abbe::daemon
