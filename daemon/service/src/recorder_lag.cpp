#include "abbe/service/recorder_lag.hpp"

#include <fmt/format.h>

namespace abbe::daemon {
namespace {

/// The largest of 1, 2, 5, 10, 20, 50 ... that is not above `value`; 0 below 1. A text that
/// contains it does not change every second.
int round_down(double value) {
  int step = 1;
  for (const int factor : {2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000})
    if (value >= factor) step = factor;
  return value >= 1.0 ? step : 0;
}

/// The time as text, rounded down: "5 s", "200 ms".
std::string rounded_text(std::chrono::nanoseconds t) {
  const double t_s = std::chrono::duration<double>(t).count();
  return t_s >= 1.0 ? fmt::format("{} s", round_down(t_s))
                    : fmt::format("{} ms", round_down(1e3 * t_s));
}

}  // namespace

std::string text_of_lag(std::chrono::nanoseconds behind, std::chrono::nanoseconds chunk_period) {
  if (behind < 2 * chunk_period) return {};
  return fmt::format(
      "the file is more than {} behind the machine (chunk_period_ms = {}): what is not written "
      "is lost if abbed ends; check the disk and the load of the computer",
      rounded_text(behind),
      std::chrono::duration_cast<std::chrono::milliseconds>(chunk_period).count());
}

}  // namespace abbe::daemon
