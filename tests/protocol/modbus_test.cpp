#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <initializer_list>
#include <vector>

#include "abbe/protocol/modbus/read.hpp"
#include "abbe/protocol/modbus/registers.hpp"

namespace abbe::protocol::modbus {
namespace {

std::vector<std::byte> bytes(std::initializer_list<int> values) {
  std::vector<std::byte> out;
  for (const int v : values) out.push_back(static_cast<std::byte>(v));
  return out;
}

constexpr ReadRequest kRequest{17, Function::ReadHoldingRegisters, 0x006B, 3};

TEST(Modbus, ComputesTheChecksumOfTheStandard) {
  EXPECT_EQ(crc16(bytes({0x02, 0x07})), 0x1241);  // [Modbus over Serial Line V1.02] 6.2.2
}

TEST(Modbus, EncodesTcpRequestsAsInTheStandard) {
  std::array<std::byte, 32> out{};
  const auto n = encode(kRequest, Transport::Tcp, out);
  // [Modbus V1.1b3] 6.3
  const auto wanted = bytes({0, 0, 0, 0, 0, 6, 17, 3, 0x00, 0x6B, 0x00, 0x03});
  EXPECT_EQ(std::vector<std::byte>(out.begin(), out.begin() + static_cast<std::ptrdiff_t>(n)),
            wanted);
}

TEST(Modbus, ReadsItsOwnRequestsBack) {
  for (const auto transport : {Transport::Tcp, Transport::Rtu}) {
    std::array<std::byte, 32> out{};
    const auto n = encode(kRequest, transport, out);
    const auto request = decode_request(std::span{out}.first(n), transport);
    ASSERT_TRUE(request);
    EXPECT_EQ(*request, kRequest);
  }
}

TEST(Modbus, WritesNothingIntoATooSmallBuffer) {
  std::array<std::byte, 11> out{};
  EXPECT_EQ(encode(kRequest, Transport::Tcp, out), 0u);
}

TEST(Modbus, DecodesTheAnswerOfTheStandard) {
  // [Modbus V1.1b3] 6.3: registers 108 to 110 hold 022Bh, 0000h, 0064h.
  const auto frame = bytes({0, 0, 0, 0, 0, 9, 17, 3, 6, 0x02, 0x2B, 0x00, 0x00, 0x00, 0x64});
  const auto answer = decode_answer(frame, Transport::Tcp, kRequest);
  ASSERT_TRUE(answer && *answer);
  EXPECT_EQ(
      decode_register((*answer)->registers.first(2), RegisterType::Uint16, WordOrder::HighFirst),
      555.0);
  EXPECT_EQ(
      decode_register((*answer)->registers.last(2), RegisterType::Uint16, WordOrder::HighFirst),
      100.0);
}

TEST(Modbus, WaitsForTheWholeAnswer) {
  const auto frame = bytes({0, 0, 0, 0, 0, 9, 17, 3, 6, 0x02, 0x2B, 0x00, 0x00, 0x00, 0x64});
  for (std::size_t n = 0; n < frame.size(); ++n)
    EXPECT_FALSE(decode_answer(std::span{frame}.first(n), Transport::Tcp, kRequest))
        << n << " bytes";
}

TEST(Modbus, NamesTheException) {
  const auto answer =
      decode_answer(bytes({0, 0, 0, 0, 0, 3, 17, 0x83, 2}), Transport::Tcp, kRequest);
  ASSERT_TRUE(answer && *answer);
  EXPECT_EQ((*answer)->exception, 2);
  EXPECT_EQ(name_of_exception(2), "illegal data address");
}

TEST(Modbus, RefusesTheAnswerOfAnotherUnit) {
  const auto answer = decode_answer(bytes({18}), Transport::Rtu, kRequest);
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->error(), DecodeError::Unit);
}

TEST(Modbus, RefusesTheAnswerToAnotherRequest) {
  const auto answer = decode_answer(bytes({17, 3, 4}), Transport::Rtu, kRequest);
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->error(), DecodeError::Length);
}

TEST(ModbusRegisters, TakeTheLowWordFirstAsVaisalaDoes) {
  // 30.56 %RH = 41F47AE1h is on the wire as 7AE1 41F4 (Vaisala M212287EN).
  const auto words = bytes({0x7A, 0xE1, 0x41, 0xF4});
  EXPECT_FLOAT_EQ(
      static_cast<float>(decode_register(words, RegisterType::Float32, WordOrder::LowFirst)),
      30.56F);
}

TEST(ModbusRegisters, GiveNanForValuesThatAreNotAvailable) {
  EXPECT_TRUE(std::isnan(
      decode_register(bytes({0x7F, 0xC0, 0, 0}), RegisterType::Float32, WordOrder::HighFirst)));
  EXPECT_TRUE(std::isnan(
      decode_register(bytes({0x7F, 0x80, 0, 0}), RegisterType::Float32, WordOrder::HighFirst)));
  EXPECT_TRUE(
      std::isnan(decode_register(bytes({0x12, 0x3A}), RegisterType::Bcd16, WordOrder::HighFirst)));
}

TEST(ModbusRegisters, HaveSignsWhereTheirTypeHas) {
  EXPECT_EQ(decode_register(bytes({0xFF, 0xFE}), RegisterType::Int16, WordOrder::HighFirst), -2.0);
  EXPECT_EQ(decode_register(bytes({0xFF, 0xFE}), RegisterType::Uint16, WordOrder::HighFirst),
            65534.0);
  EXPECT_EQ(
      decode_register(bytes({0xFF, 0xFF, 0xFF, 0xFE}), RegisterType::Int32, WordOrder::HighFirst),
      -2.0);
  EXPECT_EQ(
      decode_register(bytes({0x20, 0x96, 0x12, 0x34}), RegisterType::Bcd32, WordOrder::HighFirst),
      20961234.0);
}

}  // namespace
}  // namespace abbe::protocol::modbus
