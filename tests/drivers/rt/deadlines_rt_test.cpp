#include <gtest/gtest.h>

#include <array>

#include "abbe/drivers/deadlines.hpp"
#include "rt_guards.hpp"

namespace abbe::drivers {
namespace {

using namespace std::chrono_literals;
using protocol::HostTime;

enum class Due { Answer, Repeat, Silence };
constexpr std::array kWaiting{Due::Repeat};

void set_and_pass(std::size_t i) ABBE_RT {
  const HostTime t{1h + 1ms * i};
  Deadlines<Due::Silence> deadlines;
  deadlines.set(Due::Repeat, t);
  deadlines.set(Due::Silence, t + 1ms);
  if (deadlines.passed(deadlines.next(kWaiting), kWaiting) == Due::Silence)
    deadlines.cancel(Due::Silence);
}

TEST(DeadlinesRt, TakeNoMemory) {
  tests::expect_no_allocation(10'000, set_and_pass);
}

TEST(DeadlinesRt, MakeNoSystemCall) {
  tests::expect_no_system_call([] {
    for (std::size_t i = 0; i < 100; ++i) set_and_pass(i);
  });
}

}  // namespace
}  // namespace abbe::drivers
