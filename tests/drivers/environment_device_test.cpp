#include "abbe/drivers/environment/device.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "abbe/drivers/environment/known_maps.hpp"
#include "abbe/sim/modbus_server.hpp"
#include "modbus_peer.hpp"
#include "stepped_time.hpp"

namespace abbe::tests {
namespace {

using namespace std::chrono_literals;
using drivers::EnvironmentDevice;
using drivers::EnvironmentDeviceOptions;
using protocol::EnvironmentSample;
using testing::HasSubstr;

/// Driver and simulated device (libmodbus on both sides) in one thread.
class EnvironmentAgainstTheSimulator : public testing::Test {
 protected:
  void start(const sim::ModbusIdentity& identity, const drivers::RegisterMap& map) {
    sim::ModbusServerOptions options;
    options.identity = identity;
    options.environment.air_temperature_C = {21.3};
    options.environment.air_pressure_hPa = {987.6};
    options.environment.relative_humidity_percent = {30.5};
    for (std::size_t i = 0; i < options.environment.temperature_C.size(); ++i)
      options.environment.temperature_C[i] = {20.0 + static_cast<double>(i)};

    if (link_.empty()) {
      options.endpoint = sim::ModbusTcpEndpoint{};
    } else {
      options.endpoint = sim::ModbusPtyEndpoint{link_};
    }

    server_ =
        std::make_unique<sim::ModbusServer>(sim::ModbusServer::open(options, time_.now()).value());
    EnvironmentDeviceOptions device;
    device.name = "air";

    if (link_.empty()) {
      device.address = drivers::ModbusTcp{"127.0.0.1", server_->port()};
    } else {
      device.address = drivers::ModbusSerial{.path = link_};
    }

    device.map = map;
    device.period = 100ms;
    device.answer_timeout = 300ms;
    device_ = EnvironmentDevice::create(device, time_).value();
  }

  void turns(int count) {
    for (int i = 0; i < count; ++i) {
      server_->poll(time_.now());
      device_->wait(10ms);
      device_->receive();
      time_.advance(10ms);
    }
  }
  std::vector<EnvironmentSample> samples() {
    std::array<EnvironmentSample, 64> out{};
    const auto n = device_->samples().pop(out);
    return {out.begin(), out.begin() + static_cast<std::ptrdiff_t>(n)};
  }

  SteppedTime time_;
  std::string link_;
  std::unique_ptr<sim::ModbusServer> server_;
  std::unique_ptr<EnvironmentDevice> device_;
};

TEST_F(EnvironmentAgainstTheSimulator, ReadsTheVaisala) {
  start({.model = sim::ModbusModel::Indigo520Hmp},
        drivers::known_map("vaisala-indigo520-hmp", {}).value());
  turns(40);
  const auto got = samples();
  ASSERT_FALSE(got.empty()) << device_->status().last_fault;
  EXPECT_NEAR(got[0].air_temperature_K, 294.45, 1e-4);  // a float has seven digits
  EXPECT_NEAR(got[0].air_pressure_Pa, 98760.0, 1e-2);
  EXPECT_NEAR(got[0].relative_humidity, 0.305, 1e-7);
  EXPECT_EQ(got[0].measured, protocol::kAllOfTheAir);
}

TEST_F(EnvironmentAgainstTheSimulator, ReadsTheComet) {
  start({.model = sim::ModbusModel::CometT7510, .serial_number = 20961234},
        drivers::known_map("comet-t7510", {.serial_number = 20961234}).value());
  turns(40);
  const auto got = samples();
  ASSERT_FALSE(got.empty()) << device_->status().last_fault;
  EXPECT_NEAR(got[0].air_temperature_K, 294.45, 1e-9);
  EXPECT_NEAR(got[0].air_pressure_Pa, 98760.0, 1e-9);
  EXPECT_NEAR(got[0].relative_humidity, 0.305, 1e-12);
}

TEST_F(EnvironmentAgainstTheSimulator, ReadsResistanceThermometersOnASerialLine) {
  std::string folder = (std::filesystem::temp_directory_path() / "abbe-rtd-XXXXXX").string();
  ASSERT_NE(mkdtemp(folder.data()), nullptr);
  link_ = folder + "/rtd";
  start(
      {.model = sim::ModbusModel::Zt2005C8, .unit = 3},
      drivers::known_map("icpdas-zt2005-c8", {.inputs = {0, std::nullopt, 5}, .unit = 3}).value());
  turns(20);
  const auto got = samples();
  server_.reset();
  std::filesystem::remove_all(folder);

  ASSERT_FALSE(got.empty()) << device_->status().last_fault;
  EXPECT_EQ(got[0].measured, protocol::temperature_bit(0) | protocol::temperature_bit(5));
  EXPECT_NEAR(got[0].temperature_K[0], 293.15, 1e-9);
  EXPECT_NEAR(got[0].temperature_K[5], 295.15, 1e-9);
  EXPECT_TRUE(std::isnan(got[0].air_temperature_K));
}

TEST_F(EnvironmentAgainstTheSimulator, RefusesAnotherSerialNumberByName) {
  start({.model = sim::ModbusModel::CometT7510, .serial_number = 20961235},
        drivers::known_map("comet-t7510", {.serial_number = 20961234}).value());
  turns(20);
  EXPECT_TRUE(samples().empty());
  EXPECT_EQ(device_->status().state, "refused");
  EXPECT_THAT(device_->status().last_fault, HasSubstr("serial number is 20961235, not 20961234"));
}

TEST_F(EnvironmentAgainstTheSimulator, RefusesAnAddressBaseThatIsOffByOne) {
  auto map = drivers::known_map("comet-t7510", {.serial_number = 20961234}).value();
  map.base_offset = -1;
  start({.model = sim::ModbusModel::CometT7510, .serial_number = 20961234}, map);
  turns(20);
  EXPECT_TRUE(samples().empty());
  EXPECT_EQ(device_->status().state, "refused");
  EXPECT_THAT(device_->status().last_fault, HasSubstr("register map comet-t7510 does not match"));
}

TEST_F(EnvironmentAgainstTheSimulator, RefusesTheMapOfAnotherDevice) {
  start({.model = sim::ModbusModel::CometT7510},
        drivers::known_map("vaisala-indigo520-hmp", {}).value());
  turns(20);
  EXPECT_TRUE(samples().empty());
  EXPECT_EQ(device_->status().state, "refused");
  EXPECT_THAT(device_->status().last_fault, HasSubstr("vaisala-indigo520-hmp does not match"));
}

TEST_F(EnvironmentAgainstTheSimulator, RefusesSwappedWordsBecauseTheyAreImplausible) {
  auto map = drivers::known_map("vaisala-indigo520-hmp", {}).value();
  for (auto& measured : map.measured) measured.place.order = modbus::WordOrder::HighFirst;
  start({.model = sim::ModbusModel::Indigo520Hmp}, map);
  turns(20);
  EXPECT_TRUE(samples().empty());
  EXPECT_EQ(device_->status().state, "refused");
}

TEST_F(EnvironmentAgainstTheSimulator, ReportsNotAvailableWhenTheSensorIsMissing) {
  start({.model = sim::ModbusModel::Indigo520Hmp},
        drivers::known_map("vaisala-indigo520-hmp", {}).value());
  turns(40);
  (void)samples();
  server_->inject({.kind = sim::FaultKind::SensorsGone, .duration_s = 10.0}, time_.now());
  turns(30);
  const auto got = samples();
  ASSERT_FALSE(got.empty());
  EXPECT_TRUE(std::isnan(got.back().air_temperature_K));
  EXPECT_FALSE(std::isnan(got.back().air_pressure_Pa));
  EXPECT_EQ(got.back().measured, protocol::kAllOfTheAir);
}

TEST_F(EnvironmentAgainstTheSimulator, TreatsBusyAsATransientFault) {
  start({.model = sim::ModbusModel::CometT7510},
        drivers::known_map("comet-t7510", {.serial_number = 20969999}).value());
  turns(20);
  server_->inject({.kind = sim::FaultKind::ModbusException, .duration_s = 0.2}, time_.now());
  turns(10);
  EXPECT_THAT(device_->status().last_fault, HasSubstr("device busy"));
  (void)samples();
  turns(60);
  EXPECT_FALSE(samples().empty());
}

TEST_F(EnvironmentAgainstTheSimulator, ReadsAgainAfterEveryFault) {
  start({.model = sim::ModbusModel::CometT7510},
        drivers::known_map("comet-t7510", {.serial_number = 20969999}).value());
  turns(20);

  for (const auto kind :
       {sim::FaultKind::Mute, sim::FaultKind::ModbusGarbage, sim::FaultKind::Disconnect}) {
    const auto faults = device_->status().faults;
    server_->inject({.kind = kind, .duration_s = 0.5}, time_.now());
    turns(50);
    EXPECT_GT(device_->status().faults, faults);
    (void)samples();
    turns(100);
    EXPECT_FALSE(samples().empty()) << device_->status().last_fault;
    EXPECT_EQ(device_->status().state, "reading");
  }
}

TEST_F(EnvironmentAgainstTheSimulator, ToleratesLateAnswersWithinTheTimeOut) {
  start({.model = sim::ModbusModel::CometT7510},
        drivers::known_map("comet-t7510", {.serial_number = 20969999}).value());
  server_->inject({.kind = sim::FaultKind::Late, .duration_s = 100.0, .value = 0.2}, time_.now());
  turns(300);
  EXPECT_GE(samples().size(), 2u);
  EXPECT_EQ(device_->status().faults, 0u) << device_->status().last_fault;
}

TEST_F(EnvironmentAgainstTheSimulator, MakesTheSameSamplesFromTheRawBytes) {
  start({.model = sim::ModbusModel::Indigo520Hmp},
        drivers::known_map("vaisala-indigo520-hmp", {}).value());
  turns(60);
  server_->inject({.kind = sim::FaultKind::ModbusGarbage, .duration_s = 0.1}, time_.now());
  turns(60);
  const auto live = samples();
  ASSERT_GE(live.size(), 3u);
  drivers::EnvironmentReceiver replay{drivers::known_map("vaisala-indigo520-hmp", {}).value(),
                                      modbus::Transport::Tcp};
  std::vector<EnvironmentSample> replayed;
  std::array<protocol::RawBlock, 256> blocks;
  const auto n = device_->raw().pop(blocks);

  for (std::size_t i = 0; i < n; ++i) {
    if (replay.on_raw(blocks[i])) replayed.push_back(replay.sample());
  }

  ASSERT_EQ(replayed.size(), live.size());
  for (std::size_t i = 0; i < live.size(); ++i) {
    EXPECT_EQ(replayed[i].head.time, live[i].head.time);
    EXPECT_EQ(replayed[i].head.flags, live[i].head.flags);
    EXPECT_EQ(replayed[i].air_pressure_Pa, live[i].air_pressure_Pa);
    EXPECT_EQ(replayed[i].relative_humidity, live[i].relative_humidity);
  }
}

}  // namespace
}  // namespace abbe::tests
