/// Another device answers on the configured port: it is reported by name and gives no samples.

#include <gmock/gmock.h>

#include <chrono>
#include <string>
#include <thread>

#include "abbe/devices/device_set.hpp"
#include "abbe/sim/modbus_server.hpp"
#include "config_tables.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

const std::string kConfiguredMill = to_toml(config_tables::half_metre_mill());

struct Expecting {
  std::string device;  ///< its table, without the port
  std::string name;
};

class WrongDevice : public testing::TestWithParam<Expecting> {};

TEST_P(WrongDevice, IsReportedByNameAndGivesNoSamples) {
  const drivers::MonotonicTime time;
  auto thermometer = sim::ModbusServer::open({}, time.now()).value();
  const std::string port = std::to_string(thermometer.port());
  const auto config =
      parse_config(kConfiguredMill + GetParam().device + "port = " + port + "\n", "abbed.toml");
  ASSERT_TRUE(config) << config.error().details.front();
  auto devices = DeviceSet::start(*config, time);
  ASSERT_TRUE(devices) << devices.error().text;
  Batch batch;
  drivers::DeviceStatus status;
  const auto patience = std::chrono::steady_clock::now() + 20s;

  while (status.last_fault.empty() && std::chrono::steady_clock::now() < patience) {
    thermometer.poll(time.now());
    devices->drain(batch);
    status = devices->health(time.now()).front().status;
    std::this_thread::sleep_for(1ms);
  }

  EXPECT_EQ(status.name, GetParam().name);
  EXPECT_THAT(status.last_fault, HasSubstr(port));
  EXPECT_EQ(status.samples, 0u);
  EXPECT_TRUE(batch.points.empty() && batch.axes.empty() && batch.touches.empty());
}

INSTANTIATE_TEST_SUITE_P(
    Devices, WrongDevice,
    testing::Values(Expecting{"[tracker]\nhost = \"127.0.0.1\"\ncommand_timeout_s = 0.3\n",
                              "tracker"},
                    Expecting{"[cmm]\nhost = \"127.0.0.1\"\ncommand_timeout_s = 0.3\n", "cmm"},
                    Expecting{"[counter_card]\ntransport = \"usbip\"\naxes = [{axis = \"X\", "
                              "channel = 0, step_nm = 10}, "
                              "{axis = \"Y\", channel = 1, step_nm = 10}, {axis = \"Z\", channel = "
                              "2, step_nm = 10}]\n",
                              "counter_card"}),
    [](const auto& expecting) { return expecting.param.name; });

}  // namespace
}  // namespace abbe::daemon
