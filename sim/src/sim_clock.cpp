#include "abbe/sim/sim_clock.hpp"

#include <ctime>

namespace abbe::sim {

HostTime SimClock::now() const {
  timespec t{};
  clock_gettime(CLOCK_MONOTONIC, &t);
  const std::int64_t monotonic_ns = std::int64_t{t.tv_sec} * 1'000'000'000 + t.tv_nsec;
  // long double: after months of uptime the product in ns exceeds the 53 bits of a double.
  return HostTime{std::chrono::nanoseconds{static_cast<std::int64_t>(
      static_cast<long double>(speed_) * static_cast<long double>(monotonic_ns))}};
}

std::chrono::nanoseconds SimClock::wall(std::chrono::nanoseconds d) const {
  return std::chrono::nanoseconds{
      static_cast<std::int64_t>(static_cast<double>(d.count()) / speed_)};
}

}  // namespace abbe::sim
