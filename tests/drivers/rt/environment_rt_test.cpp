#include <gtest/gtest.h>

#include "../modbus_script.hpp"
#include "abbe/drivers/environment/receiver.hpp"
#include "rt_guards.hpp"

namespace abbe::tests {
namespace {

using namespace std::chrono_literals;
using drivers::EnvironmentReceiver;
using modbus::Transport;

class EnvironmentRealTimePath : public testing::TestWithParam<Transport> {
 protected:
  EnvironmentRealTimePath() {
    receiver_.begin();
    for (int i = 0; i < 3; ++i) {
      const auto request = receiver_.next_request().value();
      answers_.push_back(modbus_answer(GetParam(), request, small_registers()));
      receiver_.sent(request, {});
      (void)receiver_.push(answers_.back(), {});
    }
  }
  /// A connection: proving, a round, garbage.
  void cycle(std::size_t i) ABBE_RT {
    const protocol::HostTime t{1h + 1ms * i};
    receiver_.begin();
    for (const auto& answer : answers_) {
      if (const auto request = receiver_.next_request()) receiver_.sent(*request, t);
      (void)receiver_.push(answer, t);
    }
    if (const auto request = receiver_.next_request()) receiver_.sent(*request, t);
    (void)receiver_.push(garbage_, t);
  }
  EnvironmentReceiver receiver_{small_map(), GetParam()};
  std::vector<ModbusBytes> answers_;
  ModbusBytes garbage_ = ModbusBytes(50, std::byte{0x55});
};

TEST_P(EnvironmentRealTimePath, TakesNoMemory) {
  expect_no_allocation(10'000, [&](std::size_t i) { cycle(i); });
  EXPECT_GE(receiver_.counters().samples, 10'000u);
}

TEST_P(EnvironmentRealTimePath, MakesNoSystemCall) {
  cycle(0);  // the first virtual call makes UBSan look at the object through the kernel
  expect_no_system_call([&] {
    for (std::size_t i = 0; i < 100; ++i) cycle(i);
  });
}

INSTANTIATE_TEST_SUITE_P(Transports, EnvironmentRealTimePath,
                         testing::Values(Transport::Tcp, Transport::Rtu),
                         [](const auto& i) { return i.param == Transport::Tcp ? "Tcp" : "Rtu"; });

}  // namespace
}  // namespace abbe::tests
