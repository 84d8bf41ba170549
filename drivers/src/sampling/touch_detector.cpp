#include "abbe/drivers/sampling/touch_detector.hpp"

#include <cmath>

namespace abbe::drivers {
namespace {

using std::chrono::nanoseconds;

std::int64_t counts_of(nanoseconds d, const TouchOptions& options) {
  return std::llround(1e-9 * static_cast<double>(d.count()) * options.wiring.clock_hz);
}

bool debounced(const TouchOptions& options) {
  return options.wiring.counter_debounce > nanoseconds{};
}

EdgeRules rules_of(const TouchOptions& options) {
  const nanoseconds confirm =
      debounced(options) ? options.wiring.counter_debounce : options.switching.confirm;
  return {counts_of(confirm, options), counts_of(options.switching.chatter, options),
          debounced(options)};
}

/// Number of scans to keep: from the earliest scan that a touch needs to the scan of its
/// confirmation, with a factor of two as reserve.
std::size_t past_of(const TouchOptions& o) {
  const nanoseconds past = o.delay.delay + 2 * (o.switching.confirm + o.wiring.counter_debounce) +
                           o.approach.speed_window + o.window_before;
  return static_cast<std::size_t>(2 * (past / o.wiring.scan_period) + 16);
}

}  // namespace

TouchDetector::TouchDetector(const TouchOptions& options)
    : options_(options),
      history_(past_of(options), options.wiring.clock_hz),
      edges_(rules_of(options)),
      touches_(options.touch_capacity),
      windows_(options.window_capacity),
      debounce_counts_(counts_of(options.wiring.counter_debounce, options)),
      quiet_counts_(counts_of(options.switching.rearm_quiet, options)),
      after_counts_(counts_of(options.window_after, options)) {}

}  // namespace abbe::drivers
