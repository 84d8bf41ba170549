// From the configuration to the recording: real threads, a simulated Modbus device on its port.

#include <gmock/gmock.h>

#include <chrono>
#include <thread>

#include "abbe/devices/device_kind.hpp"
#include "abbe/devices/device_set.hpp"
#include "abbe/drivers/environment/receiver.hpp"
#include "abbe/recording/recorder_thread.hpp"
#include "abbe/sim/modbus_server.hpp"
#include "config_tables.hpp"
#include "recording_fixture.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

constexpr std::uint32_t kSerial = 20961234;

Config config_with(std::uint16_t port, const std::string& device) {
  const auto config = parse_config(
      to_toml(config_tables::half_metre_mill()) +
          "[[environment]]\nname = \"air\"\nhost = \"127.0.0.1\"\nperiod_s = 0.05\nport = " +
          std::to_string(port) + "\n" + device,
      "abbed.toml");
  EXPECT_TRUE(config) << config.error().details.front();
  return config ? *config : Config{};
}

Config config_for(std::uint16_t port, std::uint32_t serial) {
  return config_with(port,
                     "map = \"comet-t7510\"\nserial_number = " + std::to_string(serial) + "\n");
}

class EnvironmentDevices : public testing::Test {
 protected:
  /// Serves the device until `done`, ten seconds at most.
  template <class Done>
  bool serve_until(DeviceSet& devices, Done done) {
    const auto end = std::chrono::steady_clock::now() + 10s;
    while (std::chrono::steady_clock::now() < end) {
      server_.poll(time_.now());
      devices.drain(batch_);
      if (done()) return true;
      std::this_thread::sleep_for(1ms);
    }
    return false;
  }

  drivers::MonotonicTime time_;
  sim::ModbusServer server_ =
      sim::ModbusServer::open(
          {.identity = {.model = sim::ModbusModel::CometT7510, .serial_number = kSerial}},
          time_.now())
          .value();
  Batch batch_;
  TemporaryFolder folder_;
};

TEST_F(EnvironmentDevices, AreReadRecordedAndDecodedAgainFromTheirBytes) {
  const auto config = config_for(server_.port(), kSerial);
  {
    auto devices = DeviceSet::start(config, time_);
    ASSERT_TRUE(devices) << devices.error().text;
    ASSERT_TRUE(serve_until(*devices, [this] { return batch_.measured_environment.size() >= 3; }))
        << devices->health(time_.now()).front().status.last_fault;
    EXPECT_EQ(devices->health(time_.now()).front().status.name, "air");
  }

  {
    auto recorder = RecorderThread::start(
        {.recorder = example_options(folder_.path()), .devices = device_names(config)},
        example_info());
    ASSERT_TRUE(recorder) << recorder.error().text;
    (*recorder)->hand_over(batch_);
  }

  auto reader = RecordingReader::open(folder_.path() / "run.mcap");
  ASSERT_TRUE(reader) << reader.error().text;
  drivers::EnvironmentReceiver receiver{config.of<EnvironmentConfig>()[0].map,
                                        drivers::modbus::Transport::Tcp};
  std::vector<protocol::EnvironmentSample> samples;
  std::vector<protocol::EnvironmentSample> decoded;
  RecordingSink sink;

  sink.environment = [&](const protocol::EnvironmentSample& s, std::string_view device) {
    EXPECT_EQ(device, "air");
    samples.push_back(s);
  };

  sink.raw_block = [&](const protocol::RawBlock& block, std::string_view) {
    if (receiver.on_raw(block)) decoded.push_back(receiver.sample());
  };

  EXPECT_EQ(reader->read(sink), 0u);
  ASSERT_EQ(samples.size(), batch_.measured_environment.size());
  ASSERT_GE(decoded.size(), samples.size());

  for (std::size_t i = 0; i < samples.size(); ++i) {
    EXPECT_EQ(samples[i].head.time, decoded[i].head.time);
    EXPECT_EQ(samples[i].air_pressure_Pa, decoded[i].air_pressure_Pa);
    EXPECT_EQ(samples[i].measured, protocol::kAllOfTheAir);
  }
}

TEST_F(EnvironmentDevices, ReportByNameThatAnotherDeviceAnswers) {
  auto devices = DeviceSet::start(config_for(server_.port(), kSerial + 1), time_);
  ASSERT_TRUE(devices) << devices.error().text;
  const auto refused = [&] {
    return devices->health(time_.now()).front().status.state == "refused";
  };
  ASSERT_TRUE(serve_until(*devices, refused));
  EXPECT_THAT(devices->health(time_.now()).front().status.last_fault,
              HasSubstr("serial number is 20961234, not 20961235"));
  EXPECT_TRUE(batch_.measured_environment.empty());
}

TEST_F(EnvironmentDevices, ReportByNameThatTheRegisterMapDiffers) {
  const auto config =
      config_with(server_.port(),
                  "map = \"custom\"\n"
                  "[[environment.measured]]\nquantity = \"air_pressure\"\naddress = 52\n"
                  "type = \"int16\"\nquantity_unit = \"hPa\"\nscale = 0.1\n"
                  "[[environment.proving]]\nname = \"device type\"\naddress = 49\n"
                  "type = \"uint16\"\nexpected = 4711\n");
  auto devices = DeviceSet::start(config, time_);
  ASSERT_TRUE(devices) << devices.error().text;

  const auto refused = [&] {
    return devices->health(time_.now()).front().status.state == "refused";
  };

  ASSERT_TRUE(serve_until(*devices, refused))
      << devices->health(time_.now()).front().status.last_fault;
  EXPECT_THAT(devices->health(time_.now()).front().status.last_fault, HasSubstr("device type is"));
  EXPECT_TRUE(batch_.measured_environment.empty());
}

}  // namespace
}  // namespace abbe::daemon
