#include "abbe/drivers/environment/receiver.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "abbe/drivers/environment/known_maps.hpp"
#include "modbus_script.hpp"

namespace abbe::tests {
namespace {

using namespace std::chrono_literals;
using drivers::EnvironmentReceiver;
using drivers::Quantity;
using modbus::Transport;
using protocol::HostTime;
using testing::HasSubstr;
using Progress = EnvironmentReceiver::Progress;

constexpr HostTime kLineStart{1h};

class Receiver : public testing::TestWithParam<Transport> {
 protected:
  /// Asks and answers once.
  Progress step() {
    const auto request = receiver_.next_request();
    if (!request) return Progress::Waiting;
    receiver_.sent(*request, now_);
    now_ += 20ms;
    return receiver_.push(modbus_answer(GetParam(), *request, registers_), now_);
  }
  void to_first_sample() {
    receiver_.begin();
    for (int i = 0; i < 3; ++i) last_ = step();
  }
  EnvironmentReceiver receiver_{small_map(), GetParam()};
  std::map<std::uint16_t, std::uint16_t> registers_ = small_registers();
  HostTime now_ = kLineStart;
  Progress last_ = Progress::Waiting;
};

TEST_P(Receiver, ChecksTheDeviceThenMeasures) {
  to_first_sample();
  ASSERT_EQ(last_, Progress::Sample);
  const auto& s = receiver_.sample();
  EXPECT_NEAR(s.air_temperature_K, 294.65, 1e-9);
  EXPECT_NEAR(s.air_pressure_Pa, 101310.0, 1e-9);
  EXPECT_NEAR(s.temperature_K[3], 293.55, 1e-9);
  EXPECT_TRUE(std::isnan(s.relative_humidity));
  EXPECT_EQ(s.measured,
            protocol::kAirTemperature | protocol::kAirPressure | protocol::temperature_bit(3));
}

TEST_P(Receiver, DatesASampleInTheMiddleOfItsRound) {
  to_first_sample();
  EXPECT_EQ(receiver_.sample().head.time, kLineStart + 40ms);  // round from 20 ms to 60 ms
  EXPECT_NEAR(static_cast<double>(receiver_.sample().head.u_time.count()), 40e6 / std::sqrt(12.0),
              1.0);
}

TEST_P(Receiver, MarksTheFirstSampleOfAConnectionOnly) {
  to_first_sample();
  EXPECT_TRUE(has(receiver_.sample().head.flags, protocol::SampleFlag::Restarted));
  step();
  ASSERT_EQ(step(), Progress::Sample);
  EXPECT_FALSE(has(receiver_.sample().head.flags, protocol::SampleFlag::Restarted));
}

TEST_P(Receiver, GivesABrokenWireAsNotAvailable) {
  registers_[30] = 0x8000;
  to_first_sample();
  ASSERT_EQ(last_, Progress::Sample);
  EXPECT_TRUE(std::isnan(receiver_.sample().temperature_K[3]));
  EXPECT_NE(receiver_.sample().measured & protocol::temperature_bit(3), 0);
}

TEST_P(Receiver, RefusesAnotherSerialNumber) {
  registers_[101] = 0x5679;
  to_first_sample();
  EXPECT_TRUE(is_refusal(receiver_.failure()));
  EXPECT_THAT(
      text_of(receiver_.failure(), receiver_.map()),
      HasSubstr("serial number is 12345679, not 12345678: wrong device or register map small"));
}

TEST_P(Receiver, RefusesAMapWhoseFirstRoundIsImplausible) {
  registers_[11] = 215;
  to_first_sample();
  EXPECT_TRUE(is_refusal(receiver_.failure()));
  EXPECT_THAT(text_of(receiver_.failure(), receiver_.map()),
              HasSubstr("air pressure reads 2150 Pa"));
}

TEST_P(Receiver, GivesAnImplausibleValueLaterOnAsNotAvailable) {
  to_first_sample();
  registers_[11] = 1;
  step();
  ASSERT_EQ(step(), Progress::Sample);
  EXPECT_TRUE(std::isnan(receiver_.sample().air_pressure_Pa));
  EXPECT_EQ(receiver_.counters().implausible, 1u);
}

TEST_P(Receiver, RefusesADeviceWithoutTheAddress) {
  receiver_.begin();
  const auto request = receiver_.next_request().value();
  receiver_.sent(request, now_);
  EXPECT_EQ(receiver_.push(modbus_exception(GetParam(), request, 2), now_), Progress::Failed);
  EXPECT_TRUE(is_refusal(receiver_.failure()));
  EXPECT_THAT(text_of(receiver_.failure(), receiver_.map()), HasSubstr("illegal data address"));
}

TEST_P(Receiver, TakesAnAnswerByteByByte) {
  receiver_.begin();
  const auto request = receiver_.next_request().value();
  receiver_.sent(request, now_);
  const auto answer = modbus_answer(GetParam(), request, registers_);
  for (std::size_t i = 0; i + 1 < answer.size(); ++i)
    ASSERT_EQ(receiver_.push(std::span{answer}.subspan(i, 1), now_), Progress::Waiting);
  EXPECT_EQ(receiver_.push(std::span{answer}.last(1), now_), Progress::Answered);
}

TEST_P(Receiver, IgnoresUnrequestedAnswers) {
  receiver_.begin();
  const auto answer = modbus_answer(GetParam(), receiver_.next_request().value(), registers_);
  EXPECT_EQ(receiver_.push(answer, now_), Progress::Failed);
  EXPECT_EQ(receiver_.failure().kind, drivers::EnvironmentFailure::Kind::Unasked);
}

TEST_P(Receiver, FindsEverySingleBrokenByteOrMakesNoSampleOfIt) {
  receiver_.begin();
  const auto request = receiver_.next_request().value();
  const auto answer = modbus_answer(GetParam(), request, registers_);
  for (std::size_t i = 0; i < answer.size(); ++i) {
    auto broken = answer;
    broken[i] ^= std::byte{0x40};
    receiver_.begin();
    receiver_.sent(request, now_);
    EXPECT_NE(receiver_.push(broken, now_), Progress::Answered) << "byte " << i;
  }
}

INSTANTIATE_TEST_SUITE_P(Transports, Receiver, testing::Values(Transport::Tcp, Transport::Rtu),
                         [](const auto& i) { return i.param == Transport::Tcp ? "Tcp" : "Rtu"; });

TEST(RegisterMap, ReadsTouchingRegistersAtOnce) {
  const auto map = drivers::known_map("vaisala-indigo520-hmp", {}).value();
  std::vector<drivers::RegisterPlace> places;
  for (const auto& m : map.measured) places.push_back(m.place);
  const auto reads = drivers::reads_for(places, 0);
  ASSERT_EQ(reads.size(), 2u);
  EXPECT_EQ(reads[0].unit, 240);
  EXPECT_EQ(reads[1].count, 4);
}

TEST(RegisterMap, IsRefusedIfItIsInconsistent) {
  EXPECT_FALSE(check(drivers::RegisterMap{}));
  auto twice = small_map();
  twice.measured.push_back(twice.measured[0]);
  EXPECT_FALSE(check(twice));
  auto scaleless = small_map();
  scaleless.measured[0].scale = 0.0;
  EXPECT_FALSE(check(scaleless));
  auto below = small_map();
  below.base_offset = -11;
  EXPECT_FALSE(check(below));
  EXPECT_TRUE(check(small_map()));
}

TEST(KnownMaps, NeedASerialNumberWhereTheAddressesAreAmbiguous) {
  EXPECT_FALSE(drivers::known_map("comet-t7510", {}));
  EXPECT_FALSE(drivers::known_map("icpdas-zt2005-c8", {.serial_number = 1}));
  EXPECT_FALSE(drivers::known_map("nobody-knows-this", {}));
}

TEST(KnownMaps, AreAllValid) {
  drivers::KnownMapOptions comet{.serial_number = 1};
  drivers::KnownMapOptions inputs{.inputs = {0, 1, 2, 3, 4, 5, 6, 7}};
  EXPECT_TRUE(check(drivers::known_map("vaisala-indigo520-hmp", {}).value()));
  EXPECT_TRUE(check(drivers::known_map("comet-t7510", comet).value()));
  EXPECT_TRUE(check(drivers::known_map("icpdas-zt2005-c8", inputs).value()));
}

}  // namespace
}  // namespace abbe::tests
