/// The live session with a Multi-Feature Bar: request, acquisition of touches as the hub brings
/// them, refusals before the first touch.
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "abbe/config/config.hpp"
#include "abbe/methods/mfb/method.hpp"
#include "abbe/tables/mfb_files.hpp"
#include "mfb_folder.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using calib::Vector3;
using protocol::HostTime;
using protocol::TouchFlag;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr HostTime kMfbFrom{10s};

std::string probed_machine(const std::string& more = {}) {
  return test::reference_machine_toml() +
         "[target]\noffset_mm = [0, 0, 0]\n"
         "[counter_card]\ntransport = \"usbip\"\nport = 3240\nlatch_channel = 6\nclock_MHz = 1\n"
         "zero = \"here\"\nscan_rate_hz = 500\naxes = [\n"
         "  { axis = \"X\", channel = 0, step_nm = 10 },\n"
         "  { axis = \"Y\", channel = 1, step_nm = 10 },\n"
         "  { axis = \"Z\", channel = 2, step_nm = 10 },\n]\n"
         "[probe]\ndelay_us = 5\njitter_us = 1\n" +
         more;
}

Config parsed(const std::string& text) {
  const auto config = parse_config(text, "abbed.toml");
  EXPECT_TRUE(config) << config.error().text << testing::PrintToString(config.error().details);
  return config.value_or(Config{});
}

MfbRequest reference_request() {
  return {{"bar.toml", test::reference_bar_toml()}, {"plan.toml", test::reference_plan_toml()}, {}};
}

protocol::Snapshot bar_touch_at(const Vector3& q_m, std::uint32_t number) {
  protocol::Snapshot s;
  s.head.time = kMfbFrom + 1s * number;
  s.has_trigger = true;
  s.trigger.touch = number;
  s.axis_count = 3;
  s.position = {q_m.x(), q_m.y(), q_m.z()};
  return s;
}

/// Places of the first `count` touches of the plan.
std::vector<Vector3> planned_readings_m(std::size_t count) {
  const auto bar = parse_bar_toml(test::reference_bar_toml(), "bar.toml");
  const auto plan = parse_bar_plan_toml(test::reference_plan_toml(), "plan.toml", bar->bar);
  const auto& m = plan->plan.measurements.front();
  const auto touches = nominal_touches(bar->bar.pattern, plan->plan.tip_radius_m);
  std::vector<Vector3> readings;
  for (const std::size_t place : probing_order(touches)) {
    if (readings.size() == count) break;
    readings.push_back(m.origin_m + m.axes() * touches[place].tip_m - m.tool_offset_m);
  }
  return readings;
}

class MfbSession : public ::testing::Test {
 protected:
  Config config = parsed(probed_machine());

  [[nodiscard]] MfbAcquisition acquisition(const MfbRequest& request = reference_request()) const {
    const MfbAcquisitionOptions options = MfbMethod::options(config);
    auto made = MfbAcquisition::create(request, options);
    EXPECT_TRUE(made) << made.error().text;
    made->begin(kMfbFrom);
    return *std::move(made);
  }
};

TEST_F(MfbSession, ARequestIsTheSameAfterItWasWritten) {
  MfbRequest request = reference_request();
  request.earlier_m = {{0.1, 1.0 / 3.0, -1e-9}};
  const auto again = MfbMethod::request_from(MfbMethod::to_json(request), nullptr);
  EXPECT_EQ(again.bar.text, request.bar.text);
  EXPECT_EQ(again.plan.name, "plan.toml");
  EXPECT_EQ(again.plan.text, request.plan.text);
  EXPECT_EQ(again.earlier_m, request.earlier_m);
}

TEST_F(MfbSession, ReportsWhatToTouchFeatureByFeature) {
  MfbAcquisition a = acquisition();
  EXPECT_EQ(a.phase(), AcquisitionPhase::WaitingAtStart);
  EXPECT_THAT(a.reason(), HasSubstr(", forward: touch hole 1, 8 points"));
  std::uint32_t number = 1;
  for (const Vector3& q_m : planned_readings_m(9)) a.take(bar_touch_at(q_m, number++));
  EXPECT_EQ(a.phase(), AcquisitionPhase::Running);
  EXPECT_THAT(a.reason(), HasSubstr("touch rod 1, 12 points"));
  EXPECT_EQ(a.next()->on, "rod 1");
  EXPECT_EQ(a.next()->touched, 1u);
  EXPECT_EQ(a.points(), 9u);
  EXPECT_THAT(a.take_notes(), IsEmpty());
}

constexpr const char* kBarSensor = R"([[environment]]
name = "rtd"
map = "icpdas-zt2005-c8"
host = "127.0.0.1"
inputs = ["scale", "bar"]
[mfb]
bar_sensor = "bar"
u_bar_K = 0.1
)";

protocol::Snapshot measured_touch_at(const Vector3& q_m, std::uint32_t number, double bar_K) {
  auto s = bar_touch_at(q_m, number);
  s.has_environment = true;
  s.environment.temperature_K[1] = bar_K;
  return s;
}

TEST_F(MfbSession, TheSensorOnTheBarReplacesTheStatedTemperatureOfThePass) {
  config = parsed(probed_machine(kBarSensor));
  MfbAcquisition a = acquisition();
  std::uint32_t number = 1;
  const auto touch = [&](const Vector3& q_m, double t_K) {
    a.take(measured_touch_at(q_m, number++, t_K));
  };
  const auto readings_m = planned_readings_m(3);
  touch(readings_m[0], 294.0);
  touch(readings_m[1], std::nan(""));
  EXPECT_EQ(a.points(), 1u);
  EXPECT_THAT(a.take_notes(),
              ElementsAre(HasSubstr("the temperature \"bar\" of the bar was not known")));
  touch(readings_m[1], 294.6);

  const MfbRun run = a.release();
  EXPECT_NEAR(run.plan.measurements[0].temperature_K.value(), 294.3, 1e-9);
  EXPECT_NEAR(run.plan.noise.u_temperature_K, 0.3 / std::sqrt(3.0), 1e-9);
  EXPECT_EQ(run.plan.noise.u_common_temperature_K, 0.1);
  const auto stated =
      parse_bar_plan_toml(test::reference_plan_toml(), "plan.toml",
                          parse_bar_toml(test::reference_bar_toml(), "bar.toml")->bar);
  EXPECT_EQ(run.plan.measurements[1].temperature_K, stated->plan.measurements[1].temperature_K);
}

TEST_F(MfbSession, OnlyTouchesOfThePassCountForTheTemperatureOfTheBar) {
  config = parsed(probed_machine(kBarSensor));
  const auto readings_m = planned_readings_m(4);
  MfbAcquisition a = acquisition();
  std::uint32_t number = 1;
  const auto touch = [&](const Vector3& q_m, double t_K) {
    a.take(measured_touch_at(q_m, number++, t_K));
  };
  // Of the first touch and one beside the bar neither may be right: both are discarded.
  touch(readings_m[0], 400.0);
  touch(readings_m[0] + Vector3(0.05, 0.05, 0.05), 400.0);
  EXPECT_EQ(a.points(), 0u);
  for (std::size_t k = 0; k < 3; ++k) touch(readings_m[k], 294.0);
  touch(readings_m[3] + Vector3(0.05, 0.05, 0.05), 500.0);
  touch(readings_m[2], 500.0);  // a second time
  EXPECT_EQ(a.points(), 3u);
  EXPECT_NEAR(a.release().plan.measurements[0].temperature_K.value(), 294.0, 1e-9);
}

/// Touches of an earlier session come without temperatures.
TEST_F(MfbSession, APassOfAnEarlierSessionKeepsTheStatedTemperature) {
  config = parsed(probed_machine(kBarSensor));
  MfbRequest request = reference_request();
  request.earlier_m = planned_readings_m(3);
  MfbAcquisition a = acquisition(request);
  const MfbRun run = a.release();
  const auto stated =
      parse_bar_plan_toml(test::reference_plan_toml(), "plan.toml",
                          parse_bar_toml(test::reference_bar_toml(), "bar.toml")->bar);
  EXPECT_EQ(run.plan.measurements[0].temperature_K, stated->plan.measurements[0].temperature_K);
  EXPECT_EQ(run.plan.noise.u_common_temperature_K,
            std::max(0.1, stated->plan.noise.common_temperature_K()));
}

TEST_F(MfbSession, TheSensorOnTheBarMustBeMeasuredAndHaveAnUncertainty) {
  const auto faults = [](const std::string& table) {
    const auto read = parse_config(probed_machine(table), "abbed.toml");
    return read ? std::vector<std::string>{} : read.error().details;
  };
  EXPECT_THAT(faults("[mfb]\nbar_sensor = \"oven\"\nu_bar_K = 0.1\n"),
              ElementsAre(HasSubstr("no [[environment]] measures a temperature \"oven\"")));
  EXPECT_THAT(faults("[mfb]\nu_bar_K = 0.1\n"), ElementsAre(HasSubstr("needs bar_sensor")));
  std::string without = kBarSensor;
  without.erase(without.find("u_bar_K"));
  EXPECT_THAT(faults(without), ElementsAre(HasSubstr("mfb.u_bar_K")));
}

TEST_F(MfbSession, ATouchThatTheProbeIsNotQualifiedForIsNamedAndNotUsed) {
  MfbAcquisition a = acquisition();
  auto fast = bar_touch_at(planned_readings_m(1).front(), 7);
  fast.trigger.touch_flags |= TouchFlag::SpeedTooHigh;
  a.take(fast);
  EXPECT_EQ(a.points(), 0u);
  EXPECT_THAT(a.take_notes(), ElementsAre(AllOf(HasSubstr("touch 7: not used: the approach was "
                                                          "faster"),
                                                HasSubstr("expected: "), HasSubstr("hole 1"))));
}

TEST_F(MfbSession, ARestartOfTheCardEndsTheRunAndTheTouchesCanBeContinued) {
  MfbAcquisition a = acquisition();
  const auto readings_m = planned_readings_m(20);
  for (std::uint32_t i = 0; i < 20; ++i) a.take(bar_touch_at(readings_m[i], i + 1));
  auto restarted = bar_touch_at(readings_m[19], 21);
  restarted.head.flags |= protocol::SampleFlag::Restarted;
  a.take(restarted);
  EXPECT_EQ(a.phase(), AcquisitionPhase::Failed);
  EXPECT_THAT(a.reason(), HasSubstr("its device restarted"));

  MfbRequest again = reference_request();
  again.earlier_m = a.readings_m();
  EXPECT_EQ(again.earlier_m, readings_m);
  EXPECT_EQ(acquisition(again).points(), 20u);
}

TEST_F(MfbSession, KnowsWhenItWasMeasuredUnlessItContinuesAnEarlierSession) {
  MfbAcquisition a = acquisition();
  const auto readings_m = planned_readings_m(20);
  for (std::uint32_t i = 0; i < 20; ++i) a.take(bar_touch_at(readings_m[i], i + 1));
  EXPECT_THAT(a.release().observed.value(), ElementsAre(kMfbFrom + 1s, kMfbFrom + 20s));

  MfbRequest request = reference_request();
  request.earlier_m = {readings_m.begin(), readings_m.begin() + 5};
  MfbAcquisition continued = acquisition(request);
  for (std::uint32_t i = 5; i < 20; ++i) continued.take(bar_touch_at(readings_m[i], i + 1));
  EXPECT_EQ(continued.release().observed, std::nullopt);
}

TEST_F(MfbSession, EarlierTouchesOfAnotherBarAreRefused) {
  MfbRequest request = reference_request();
  request.earlier_m = planned_readings_m(5);
  request.earlier_m[3] += Vector3(0.0, 0.03, 0.0);
  const MfbAcquisitionOptions options = MfbMethod::options(config);
  const auto made = MfbAcquisition::create(request, options);
  ASSERT_FALSE(made);
  EXPECT_THAT(made.error().text, HasSubstr("touch 4 of the earlier recording"));
}

TEST_F(MfbSession, NoTouchForAnHourEndsTheRunAndNamesTheCommandToContinue) {
  MfbAcquisition a = acquisition();
  a.tick(kMfbFrom + 1h + 1s);
  EXPECT_EQ(a.phase(), AcquisitionPhase::Failed);
  EXPECT_THAT(a.reason(), HasSubstr("--continue"));
}

TEST_F(MfbSession, ChecksARequestBeforeTheFirstTouch) {
  EXPECT_TRUE(MfbMethod::check(reference_request(), config));
  const auto refused = [this](const MfbRequest& request) {
    const auto checked = MfbMethod::check(request, config);
    return checked ? std::string("accepted") : checked.error().text;
  };

  MfbRequest request = reference_request();
  request.bar.text = "[bar]\n";
  EXPECT_THAT(refused(request), HasSubstr("bar.toml"));
  request = reference_request();
  request.plan.text = request.plan.text.substr(0, request.plan.text.find("[[measurement]]", 1000));
  EXPECT_THAT(refused(request), HasSubstr("the measurements do not show"));
  request = reference_request();
  request.bar.text.append(2 << 20, '#');
  EXPECT_THAT(refused(request), HasSubstr("have at most"));
}

TEST_F(MfbSession, WithoutAProbeIsRefused) {
  const Config none = parsed(
      test::reference_machine_toml() +
      "[target]\noffset_mm = [0, 0, 0]\n[encoder]\ntransport = \"socketcan\"\ninterface = "
      "\"can0\"\nnodes = [{axis = \"X\", node = 1}, {axis = \"Y\", node = 2}, {axis = \"Z\", node "
      "= 3}]\n");
  const auto checked = MfbMethod::check(reference_request(), none);
  ASSERT_FALSE(checked);
  EXPECT_THAT(checked.error().text, HasSubstr("there is no source of touches"));
}

}  // namespace
}  // namespace abbe::daemon
