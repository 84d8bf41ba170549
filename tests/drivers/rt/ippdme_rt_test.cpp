#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <string_view>

#include "abbe/drivers/ippdme/receiver.hpp"
#include "rt_guards.hpp"

namespace abbe::drivers {
namespace {

using namespace std::chrono_literals;
using protocol::HostTime;

std::span<const std::byte> bytes_of(std::string_view text) {
  return std::as_bytes(std::span{text});
}

/// A position, a touch, a failed touch, an answer for the session.
std::size_t transaction(IppReceiver& receiver, std::size_t i) ABBE_RT {
  const HostTime t{1h + 100ms * i};
  receiver.sent(bytes_of("00001 Get(X(),Y(),Z())\r\n"), t);
  receiver.sent(bytes_of("00002 PtMeas(X(1),Y(2),Z(3))\r\n"), t);
  receiver.sent(bytes_of("00003 PtMeas(X(1),Y(2),Z(3))\r\n"), t);
  receiver.push(
      bytes_of("00001 &\r\n00001 # X(1.5),Y(-2e1),Z(.25)\r\n00001 %\r\n00002 # X(1),Y(2),Z(3)\r\n"
               "00003 ! Error(2,1006,PtMeas,\"Surface not found\")\r\n00004 # \"1.4.3\"\r\n"),
      t + 50ms);
  std::size_t messages = 0;
  while (receiver.next()) ++messages;
  return messages;
}

TEST(IppReceiverRt, TakesNoMemory) {
  const auto receiver = std::make_unique<IppReceiver>();
  std::size_t messages = 0;
  tests::expect_no_allocation(10'000,
                              [&](std::size_t i) { messages += transaction(*receiver, i); });
  EXPECT_EQ(messages, 7u * 10'000);
}

TEST(IppReceiverRt, MakesNoSystemCall) {
  const auto receiver = std::make_unique<IppReceiver>();
  tests::expect_no_system_call([&] {
    for (std::size_t i = 0; i < 100; ++i) (void)transaction(*receiver, i);
  });
}

}  // namespace
}  // namespace abbe::drivers
