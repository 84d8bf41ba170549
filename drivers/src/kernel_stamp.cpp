#include "abbe/drivers/kernel_stamp.hpp"

#include <ctime>

namespace abbe::drivers {
namespace {

std::chrono::nanoseconds read(clockid_t clock) noexcept {
  std::timespec t{};
  clock_gettime(clock, &t);
  return std::chrono::seconds{t.tv_sec} + std::chrono::nanoseconds{t.tv_nsec};
}

}  // namespace

ClockPair read_clock_pair() noexcept {
  ClockPair pair;
  pair.monotonic = read(CLOCK_MONOTONIC);
  pair.realtime = read(CLOCK_REALTIME);
  return pair;
}

}  // namespace abbe::drivers
