#include "abbe/web/password_turns.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <future>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

namespace abbe::web {
namespace {

using namespace std::chrono_literals;

constexpr auto kLong = 60s;  // longer than any test

TEST(PasswordTurns, OfOneAddressOnePasswordIsCheckedAtATime) {
  PasswordTurns turns;
  const auto first = turns.wait("a", 0, kLong);
  ASSERT_TRUE(first);
  EXPECT_FALSE(turns.wait("a", 0, 1ms));
  EXPECT_TRUE(turns.wait("b", 0, kLong));
}

TEST(PasswordTurns, AtMostTwoPasswordsAreCheckedAtATime) {
  PasswordTurns turns;
  const auto a = turns.wait("a", 0, kLong);
  {
    const auto b = turns.wait("b", 0, kLong);
    EXPECT_FALSE(turns.wait("c", 0, 1ms));
  }
  EXPECT_TRUE(turns.wait("c", 0, kLong));
}

// 18 addresses that have failed wait; the first password of another one is checked before theirs.
TEST(PasswordTurns, AnAddressWithoutFailuresIsNext) {
  PasswordTurns turns;
  auto a = turns.wait("a", 0, kLong);
  auto b = std::make_unique<PasswordTurns::Turn>(turns.wait("b", 0, kLong));
  std::mutex order_mutex;
  std::vector<std::string> order;
  const auto waits = [&](const std::string& address, std::size_t failures) {
    return std::async(std::launch::async, [&, address, failures] {
      const auto turn = turns.wait(address, failures, kLong);
      const std::lock_guard lock(order_mutex);
      order.push_back(address);
    });
  };

  std::vector<std::future<void>> waiting;
  for (int i = 0; i < 18; ++i) waiting.push_back(waits("attacker " + std::to_string(i), 3));
  waiting.push_back(waits("anna", 0));
  while (turns.waiting() < waiting.size()) std::this_thread::yield();
  b.reset();
  for (auto& one : waiting) one.get();
  ASSERT_EQ(order.size(), 19U);
  EXPECT_EQ(order.front(), "anna");
}

TEST(PasswordTurns, BeyondTheLimitNobodyWaits) {
  PasswordTurns turns;
  auto a = std::make_unique<PasswordTurns::Turn>(turns.wait("a", 0, kLong));
  std::vector<std::future<bool>> waiting;
  for (std::size_t i = 0; i < PasswordTurns::kMostWaiting; ++i)
    waiting.push_back(std::async(
        std::launch::async, [&turns] { return static_cast<bool>(turns.wait("a", 0, kLong)); }));
  while (turns.waiting() < PasswordTurns::kMostWaiting) std::this_thread::yield();
  EXPECT_FALSE(turns.wait("b", 0, kLong));
  a.reset();
  for (auto& one : waiting) EXPECT_TRUE(one.get());
}

}  // namespace
}  // namespace abbe::web
