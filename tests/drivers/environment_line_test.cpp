/// Several Modbus devices on one line: a real pseudo terminal with simulated slaves on it, and a
/// gateway that takes one connection.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <map>

#include "abbe/drivers/environment/line.hpp"
#include "modbus_bus_peer.hpp"
#include "stepped_time.hpp"

namespace abbe::tests {
namespace {

using namespace std::chrono_literals;
using drivers::EnvironmentDeviceOptions;
using drivers::EnvironmentLine;
using testing::HasSubstr;

EnvironmentDeviceOptions slave(const ModbusBusPeer& bus, std::uint8_t unit) {
  EnvironmentDeviceOptions o;
  o.name = "unit " + std::to_string(unit);
  o.address = bus.address();
  o.map = small_map(unit);
  o.period = 200ms;
  o.answer_timeout = 100ms;
  return o;
}

class OneLine : public testing::TestWithParam<modbus::Transport> {
 protected:
  void SetUp() override {
    bus_.slaves[1] = {};
    bus_.slaves[2] = {};
    line_ = EnvironmentLine::create({slave(bus_, 1), slave(bus_, 2)}, time_).value();
  }
  void cycles_for(std::chrono::nanoseconds duration) {
    for (const auto end = time_.now() + duration; time_.now() < end; time_.advance(5ms)) {
      bus_.serve(time_.now());
      line_->wait(5ms);
      line_->receive();
    }
  }
  std::size_t samples_of(std::size_t i) {
    std::array<protocol::EnvironmentSample, 64> out{};
    return line_->device(i).samples().pop(out);
  }
  drivers::DeviceStatus status(std::size_t i) { return line_->device(i).status(); }

  SteppedTime time_;
  ModbusBusPeer bus_{GetParam()};
  std::unique_ptr<EnvironmentLine> line_;
};

TEST_P(OneLine, AsksOneAfterTheOtherOverOneConnection) {
  cycles_for(4s);
  for (const std::size_t i : {0u, 1u}) {
    EXPECT_GE(samples_of(i), 15u) << status(i).last_fault;
    EXPECT_EQ(status(i).faults, 0u) << status(i).last_fault;
    EXPECT_EQ(status(i).state, "reading");
  }
  EXPECT_EQ(bus_.collisions, 0u);
  EXPECT_EQ(bus_.connections(),
            GetParam() == modbus::Transport::Tcp ? 1u : 0u);  // a terminal has none
}

TEST_P(OneLine, AMuteDeviceDoesNotDelayTheOther) {
  cycles_for(2s);
  bus_.slaves[1].mute = true;
  (void)samples_of(1);
  cycles_for(4s);

  EXPECT_GE(samples_of(1), 8u) << status(1).last_fault;
  EXPECT_EQ(status(1).faults, 0u) << status(1).last_fault;
  EXPECT_EQ(status(1).state, "reading");
  EXPECT_THAT(status(0).last_fault, HasSubstr("unit 1"));
  EXPECT_THAT(status(0).last_fault, HasSubstr("no answer in 100 ms"));
  EXPECT_FALSE(status(0).connected);
  bus_.slaves[1].mute = false;
  cycles_for(2s);
  EXPECT_EQ(status(0).state, "reading");
  EXPECT_EQ(bus_.collisions, 0u);
}

TEST_P(OneLine, ALateAnswerIsNotAssignedToTheOtherDevice) {
  cycles_for(2s);
  bus_.slaves[1].late = 150ms;  // after its time-out
  cycles_for(4s);
  EXPECT_GT(status(0).faults, 3u);
  EXPECT_EQ(status(1).faults, 0u) << status(1).last_fault;
  EXPECT_EQ(bus_.collisions, 0u);
}

TEST_P(OneLine, BothReconnectWhenTheLineIsBack) {
  cycles_for(2s);
  bus_.unplug();
  cycles_for(2s);
  EXPECT_NE(status(0).state, "reading");
  EXPECT_NE(status(1).state, "reading");
  bus_.plug_in();
  (void)samples_of(0);
  (void)samples_of(1);
  cycles_for(3s);

  for (const std::size_t i : {0u, 1u}) {
    EXPECT_EQ(status(i).state, "reading") << status(i).last_fault;
    EXPECT_GE(samples_of(i), 5u);
  }
}

INSTANTIATE_TEST_SUITE_P(Modbus, OneLine,
                         testing::Values(modbus::Transport::Rtu, modbus::Transport::Tcp),
                         [](const auto& i) {
                           return i.param == modbus::Transport::Rtu ? "Rtu" : "Tcp";
                         });

/// A clock that advances by the requested waiting time at once.
class WaitedTime final : public drivers::TimeSource {
 public:
  [[nodiscard]] protocol::HostTime now() const noexcept override { return now_; }
  [[nodiscard]] std::chrono::nanoseconds wall(
      std::chrono::nanoseconds host) const noexcept override {
    now_ += host;
    return {};
  }
  [[nodiscard]] std::chrono::nanoseconds host(std::chrono::nanoseconds) const noexcept override {
    return {};
  }

 private:
  mutable protocol::HostTime now_{1h};
};

TEST(EnvironmentLine, WaitsWhileItIsClosedWhetherOneDeviceIsOnItOrTwo) {
  for (const std::size_t devices : {1u, 2u}) {
    const WaitedTime time;
    EnvironmentDeviceOptions absent;
    absent.name = "absent";
    absent.address = drivers::ModbusSerial{.path = "/dev/there-is-none"};
    absent.retry = 1s;
    absent.map = small_map(1);
    const auto line = EnvironmentLine::create({devices, absent}, time).value();
    while (line->status().faults == 0) line->wait(50ms);
    const auto begin = time.now();
    for (int i = 0; i < 10; ++i) line->wait(50ms);
    EXPECT_EQ(time.now() - begin, 500ms) << devices;
  }
}

TEST(EnvironmentLine, RefusesDevicesThatAreNotOnOneLine) {
  const SteppedTime time;
  ModbusBusPeer bus{modbus::Transport::Rtu};
  auto other = slave(bus, 2);
  std::get<drivers::ModbusSerial>(other.address).baud = 9600;
  const auto refused = EnvironmentLine::create({slave(bus, 1), other}, time);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, drivers::ErrorCode::BadConfiguration);
  EXPECT_THAT(refused.error().text, HasSubstr("unit 1"));
  EXPECT_THAT(refused.error().text, HasSubstr("unit 2"));
}

// Neither name is there at the start: they cannot be known to be one line before it is plugged in.
TEST(EnvironmentLine, TwoNamesOfALineThatWasAbsentDoNotShareItSilently) {
  SteppedTime time;
  ModbusBusPeer bus{modbus::Transport::Rtu};
  bus.slaves[1] = bus.slaves[2] = {};
  std::string folder = testing::TempDir() + "abbe-line-XXXXXX";
  ASSERT_NE(::mkdtemp(folder.data()), nullptr);
  const std::filesystem::path names{folder};
  std::vector<std::unique_ptr<EnvironmentLine>> lines;
  for (const std::uint8_t unit : {std::uint8_t{1}, std::uint8_t{2}}) {
    auto options = slave(bus, unit);
    std::get<drivers::ModbusSerial>(options.address).path =
        names / ("name-" + std::to_string(unit));
    lines.push_back(EnvironmentLine::create({options}, time).value());
  }
  for (const char* name : {"name-1", "name-2"})
    std::filesystem::create_symlink(std::get<drivers::ModbusSerial>(bus.address()).path,
                                    names / name);

  for (int i = 0; i < 800; ++i, time.advance(5ms)) {
    bus.serve(time.now());
    for (const auto& line : lines) {
      line->wait(5ms);
      line->receive();
    }
  }
  EXPECT_EQ(lines[0]->device(0).status().state, "reading")
      << lines[0]->device(0).status().last_fault;
  EXPECT_FALSE(lines[1]->device(0).status().connected);
  EXPECT_THAT(lines[1]->device(0).status().last_fault, HasSubstr("name-2"));
  EXPECT_THAT(lines[1]->device(0).status().last_fault, HasSubstr("this serial line is in use"));
  EXPECT_EQ(bus.collisions, 0u);
  std::filesystem::remove_all(names);
}

TEST(EnvironmentLine, RecognizesALineByAnyOfItsNames) {
  const ModbusBusPeer bus{modbus::Transport::Rtu};
  const auto link = std::get<drivers::ModbusSerial>(bus.address()).path;
  const drivers::ModbusSerial real{.path = std::filesystem::canonical(link).string()};
  EXPECT_TRUE(drivers::same_line(bus.address(), real));
  EXPECT_FALSE(drivers::same_line(bus.address(), drivers::ModbusSerial{.path = "/dev/null"}));
  EXPECT_FALSE(
      drivers::same_line(drivers::ModbusTcp{"10.0.0.9", 502}, drivers::ModbusTcp{"10.0.0.9", 503}));
}

}  // namespace
}  // namespace abbe::tests
