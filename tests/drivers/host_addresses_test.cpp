/// A name service that answers late, not at all, or wrongly.

#include "abbe/drivers/host_addresses.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <future>
#include <memory>
#include <new>
#include <thread>

#include "abbe/drivers/tcp_client.hpp"

namespace abbe::tests {
namespace {

using namespace std::chrono_literals;
using drivers::HostAddresses;
using drivers::look_up_host;
using testing::HasSubstr;

constexpr std::uint16_t kPort = 700;

/// A name service that answers when the test lets it. Outlives the test's objects, because look-ups
/// run on detached threads.
struct SlowNames {
  std::promise<void> answers;
  std::shared_future<void> answered{answers.get_future()};
  std::atomic<int> asked{0};

  [[nodiscard]] static drivers::HostLookUp of(const std::shared_ptr<SlowNames>& names) {
    return [names](const std::string&, std::uint16_t port) {
      ++names->asked;
      names->answered.wait();
      return look_up_host("127.0.0.3", port);
    };
  }
};

TEST(HostAddresses, AnAddressLiteralNeedsNoNameService) {
  const auto never = [](const std::string&,
                        std::uint16_t) -> drivers::Result<std::vector<drivers::HostAddress>> {
    ADD_FAILURE() << "looked up";
    return {};
  };
  HostAddresses four{"127.0.0.2", kPort, {.look_up = never}};
  EXPECT_EQ(text_of(four.next().value()), "127.0.0.2");
  HostAddresses six{"::1", kPort, {.look_up = never}};
  EXPECT_EQ(text_of(six.next().value()), "::1");
}

TEST(HostAddresses, ANameServiceThatHangsKeepsNobodyWaiting) {
  const auto names = std::make_shared<SlowNames>();
  HostAddresses host{"cmm.example", kPort, {1ms, 2s, SlowNames::of(names)}};
  for (int i = 0; i < 1000; ++i) {
    const auto none = host.next();
    ASSERT_FALSE(none);
    EXPECT_THAT(none.error().text, HasSubstr("the name service has not answered yet"));
  }
  EXPECT_LE(names->asked, 1) << "one look-up at a time";

  names->answers.set_value();
  auto found = host.next();
  for (; !found; found = host.next()) std::this_thread::yield();
  EXPECT_EQ(text_of(*found), "127.0.0.3");
}

TEST(HostAddresses, WaitsForAFirstAnswerThatComesInTime) {
  const auto names = std::make_shared<SlowNames>();
  names->answers.set_value();
  HostAddresses host{"cmm.example", kPort, {60s, 2s, SlowNames::of(names)}};
  EXPECT_EQ(text_of(host.next().value()), "127.0.0.3");
}

TEST(HostAddresses, TakesTheAddressesOfANameInTurn) {
  const auto two_addresses = [](const std::string&, std::uint16_t port) {
    auto two = look_up_host("127.0.0.4", port);
    two->push_back(look_up_host("127.0.0.5", port)->front());
    return two;
  };
  HostAddresses host{"cmm.example", kPort, {60s, 1h, two_addresses}};
  EXPECT_EQ(text_of(host.next().value()), "127.0.0.4");
  EXPECT_EQ(text_of(host.next().value()), "127.0.0.5");
  EXPECT_EQ(text_of(host.next().value()), "127.0.0.4");
}

TEST(HostAddresses, KeepsAnAddressWhileLaterLookUpsFail) {
  const auto asked = std::make_shared<std::atomic<int>>(0);
  const auto once = [asked](const std::string&, std::uint16_t port) {
    return look_up_host(++*asked == 1 ? "127.0.0.3" : "no such host", port);
  };
  HostAddresses host{"cmm.example", kPort, {60s, 0ms, once}};
  while (*asked < 4) ASSERT_EQ(text_of(host.next().value()), "127.0.0.3");
}

TEST(HostAddresses, ALookUpThatThrowsIsFollowedByAnother) {
  const auto asked = std::make_shared<std::atomic<int>>(0);
  const auto no_memory_first = [asked](const std::string&, std::uint16_t port) {
    if (++*asked == 1) throw std::bad_alloc{};
    return look_up_host("127.0.0.3", port);
  };
  HostAddresses host{"cmm.example", kPort, {60s, 0ms, no_memory_first}};
  auto found = host.next();
  for (; !found; found = host.next()) std::this_thread::yield();
  EXPECT_EQ(text_of(*found), "127.0.0.3");
}

TEST(HostAddresses, ReportsWhyANameHasNoAddress) {
  HostAddresses host{"no such host", kPort};
  const auto none = host.next();
  ASSERT_FALSE(none);
  EXPECT_THAT(none.error().text, HasSubstr("no address: "));
}

TEST(HostAddresses, AHungLookUpDoesNotKeepTheOwnerAlive) {
  const auto names = std::make_shared<SlowNames>();
  { const HostAddresses host{"cmm.example", kPort, {0ms, 2s, SlowNames::of(names)}}; }
  names->answers.set_value();
}

TEST(TcpClient, WithoutAHostIsAFault) {
  drivers::TcpClient client;
  const auto opened = client.open();
  ASSERT_FALSE(opened);
  EXPECT_EQ(opened.error().code, drivers::ErrorCode::BadConfiguration);
}

}  // namespace
}  // namespace abbe::tests
