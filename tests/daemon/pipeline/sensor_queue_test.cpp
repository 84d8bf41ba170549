/// Samples reach the checks of the sensors in one order, whatever the order of arrival.
#include "abbe/pipeline/sensor_queue.hpp"

#include <gmock/gmock.h>

#include "abbe/pipeline/environment_use.hpp"
#include "config_tables.hpp"
#include "warm_scales.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using protocol::EnvironmentSample;
using protocol::HostTime;
using testing::ElementsAre;
using testing::HasSubstr;

constexpr HostTime kQueueStart{1000s};

EnvironmentSample scale_read_at(HostTime t, double temperature_K = 294.0) {
  EnvironmentSample s;
  s.head.time = t;
  s.measured = protocol::temperature_bit(0);
  s.temperature_K[0] = temperature_K;
  return s;
}

std::vector<int> devices_in_order(SensorQueue& queue, HostTime until) {
  std::vector<int> devices;
  queue.check_until(until, [&](const SensorQueue::Waiting& read, const CheckedEnvironment&) {
    devices.push_back(static_cast<int>(read.device));
  });
  return devices;
}

TEST(SensorQueue, OrdersDevicesByInstantAndWeatherByItsCycle) {
  SensorQueue queue{{}, 600ms};
  queue.add(2, scale_read_at(kQueueStart + 30ms), 8, kQueueStart + 40ms);
  queue.add(1, scale_read_at(kQueueStart + 10ms), 16, kQueueStart + 50ms);
  queue.add(0, scale_read_at(kQueueStart + 10ms), 8, kQueueStart + 60ms);
  queue.add_weather(3, scale_read_at(kQueueStart - 5s), 1, kQueueStart + 620ms);
  EXPECT_THAT(devices_in_order(queue, kQueueStart + 609ms), ElementsAre());
  EXPECT_THAT(devices_in_order(queue, kQueueStart + 2s), ElementsAre(0, 1, 3, 2));
}

Config queue_config() {
  const auto config =
      parse_config(to_toml(config_tables::half_metre_mill()) + test::kWarmScales, "abbed.toml");
  EXPECT_TRUE(config) << config.error().details.front();
  return config ? *config : Config{};
}

class DatedInTheFuture : public testing::Test {
 protected:
  /// Taken one second after the previous one; the scale's temperature 1 s later.
  double take(std::chrono::nanoseconds ahead, double temperature_K) {
    Batch batch;
    batch.taken = now_ += 1s;
    batch.measured_environment = {{0, scale_read_at(now_ + ahead, temperature_K)}};
    merge_.take(batch);
    const auto merged = merge_.at(now_ + 1s);
    return merged ? merged->temperature_K[0] : 0.0;
  }
  HostTime now_ = kQueueStart;
  EnvironmentMerge merge_{environment_use(queue_config()), 600ms};
};

TEST_F(DatedInTheFuture, DoesNotStopTheSensor) {
  for (int i = 0; i < 3; ++i) (void)take(-100ms, 294.0);
  EXPECT_EQ(take(1h, 294.3), 294.0);
  EXPECT_EQ(merge_.newest(), now_ - 1s - 100ms);
  for (int i = 0; i < 60; ++i) (void)take(-100ms, 294.2);
  EXPECT_EQ(take(-100ms, 294.2), 294.2);
}

TEST_F(DatedInTheFuture, IsNamed) {
  (void)take(12s, 294.0);
  ASSERT_EQ(merge_.doubts().size(), 1u);
  EXPECT_EQ(merge_.doubts()[0].count, 1u);
  EXPECT_THAT(merge_.doubts()[0].latest_text,
              HasSubstr("scale_x: a reading dated 12.0 s in the future is not used"));
}

TEST_F(DatedInTheFuture, WithinASecondIsUsed) {
  for (int i = 0; i < 3; ++i) (void)take(900ms, 294.0);
  EXPECT_TRUE(merge_.doubts().empty());
}

}  // namespace
}  // namespace abbe::daemon
