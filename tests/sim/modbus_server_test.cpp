#include "abbe/sim/modbus_server.hpp"

#include <gtest/gtest.h>

#include <filesystem>

#include "abbe/sim/simulation.hpp"

namespace abbe::sim {
namespace {

using namespace std::chrono_literals;

constexpr HostTime kServerStart{1h};

std::uint16_t value_at(const std::vector<SimulatedRegister>& registers, std::uint8_t unit,
                       std::uint16_t address) {
  for (const auto& r : registers) {
    if (r.unit == unit && r.address == address) return r.value;
  }
  ADD_FAILURE() << "no register " << address << " of unit " << int{unit};
  return 0;
}

TEST(ModbusRegisters, AreStoredInTheWordOrderOfVaisala) {
  EnvironmentModel model;
  model.relative_humidity_percent = {30.56};
  const auto r = registers_of({.model = ModbusModel::Indigo520Hmp}, model, 0s, false);
  EXPECT_EQ(value_at(r, 241, 0), 0x7AE1);  // 41F47AE1h, least significant word first
  EXPECT_EQ(value_at(r, 241, 1), 0x41F4);
  EXPECT_EQ(value_at(r, 241, 0x200), 1);
}

TEST(ModbusRegisters, HoldTheSerialNumberOfACometInDecimalDigits) {
  const auto r =
      registers_of({.model = ModbusModel::CometT7510, .serial_number = 20961234}, {}, 0s, false);
  EXPECT_EQ(value_at(r, 0, 4149), 0x2096);
  EXPECT_EQ(value_at(r, 0, 4150), 0x1234);
}

TEST(ModbusRegisters, HoldNegativeTemperaturesAsTwosComplement) {
  EnvironmentModel model;
  model.air_temperature_C = {-1.5};
  const auto r = registers_of({.model = ModbusModel::CometT7510}, model, 0s, false);
  EXPECT_EQ(static_cast<std::int16_t>(value_at(r, 0, 49)), -15);
}

TEST(Course, DriftsAndSwings) {
  const Course course{20.0, 0.5, 1.0, 100.0};
  EXPECT_DOUBLE_EQ(course.at(0s), 20.0);
  EXPECT_NEAR(course.at(1h), 20.5, 1e-9);
  EXPECT_NEAR(course.at(25s), 20.0 + 0.5 * 25.0 / 3600.0 + 1.0, 1e-9);
}

TEST(ModbusServer, NamesThePortThatIsInUse) {
  const auto first = ModbusServer::open({}, kServerStart);
  ASSERT_TRUE(first);
  const auto second =
      ModbusServer::open({.endpoint = ModbusTcpEndpoint{first->port()}}, kServerStart);
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::Io);
  EXPECT_NE(second.error().text.find(std::to_string(first->port())), std::string::npos);
}

TEST(ModbusServer, RemovesItsTerminalAndCreatesItAgain) {
  std::string folder = (std::filesystem::temp_directory_path() / "abbe-sim-XXXXXX").string();
  ASSERT_NE(mkdtemp(folder.data()), nullptr);
  const std::string link = folder + "/line";

  {
    auto server = ModbusServer::open({.endpoint = ModbusPtyEndpoint{link}}, kServerStart);
    ASSERT_TRUE(server);
    EXPECT_TRUE(std::filesystem::is_symlink(link));
    server->inject({.kind = FaultKind::Disconnect, .duration_s = 1.0}, kServerStart);
    EXPECT_FALSE(std::filesystem::is_symlink(link));
    EXPECT_EQ(server->next_due(), kServerStart + 1s);
    server->poll(kServerStart + 1s);
    EXPECT_TRUE(std::filesystem::is_symlink(link));
  }

  EXPECT_FALSE(std::filesystem::is_symlink(link));
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace abbe::sim
