#include "abbe/drivers/time_source.hpp"

#include <cmath>
#include <ctime>

namespace abbe::drivers {
namespace {

std::chrono::nanoseconds scaled(std::chrono::nanoseconds d, double factor) noexcept {
  if (factor == 1.0) return d;  // exact: a double cannot hold large times to the nanosecond
  return std::chrono::nanoseconds{std::llround(static_cast<double>(d.count()) * factor)};
}

}  // namespace

protocol::HostTime MonotonicTime::now() const noexcept {
  std::timespec t{};
  clock_gettime(CLOCK_MONOTONIC, &t);
  return protocol::HostTime{
      scaled(std::chrono::seconds{t.tv_sec} + std::chrono::nanoseconds{t.tv_nsec}, speed_)};
}

std::chrono::nanoseconds MonotonicTime::wall(std::chrono::nanoseconds host) const noexcept {
  return scaled(host, 1.0 / speed_);
}

std::chrono::nanoseconds MonotonicTime::host(std::chrono::nanoseconds wall) const noexcept {
  return scaled(wall, speed_);
}

}  // namespace abbe::drivers
