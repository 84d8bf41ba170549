#include "abbe/config/touch_options.hpp"

#include <cmath>
#include <cstdint>

namespace abbe::daemon {
namespace {

std::chrono::nanoseconds nanoseconds_of(double seconds) {
  return std::chrono::nanoseconds{std::llround(1e9 * seconds)};
}

}  // namespace

drivers::TouchOptions touch_options(const ProbeConfig& probe, const CounterCardConfig& card,
                                    const MachineConfig& machine) {
  drivers::TouchOptions options;
  options.delay = probe.delay;
  options.approach = probe.approach;
  options.switching = probe.switching;
  options.window_before = probe.window_before;
  options.window_after = probe.window_after;
  drivers::ProbeWiring& wiring = options.wiring;
  wiring.clock_hz = card.wiring.clock_hz;
  wiring.use_latch = card.wiring.latch_channel.has_value();
  wiring.scan_period = nanoseconds_of(1.0 / drivers::scan_rate_hz(card.wiring));

  // A debounce of microseconds only filters noise; one that is longer than the chatter time
  // confirms the touch.
  const auto& debounce = card.wiring.edge_debounce;
  const auto debounce_time = nanoseconds_of(drivers::quad08::kDebounce_s[debounce.time_code]);
  const bool confirms =
      card.wiring.edge_channel && debounce.enabled && !debounce.trigger_before_stable;
  if (confirms && debounce_time > probe.switching.chatter) wiring.counter_debounce = debounce_time;
  wiring.linear_axes = 0;

  for (std::size_t i = 0; i < card.wiring.axes.size(); ++i) {
    const AxisConfig* axis = machine.find_axis(card.wiring.axes[i].name);
    const bool linear = axis == nullptr || axis->kind == AxisKind::Linear;
    if (linear) wiring.linear_axes = static_cast<std::uint8_t>(wiring.linear_axes | (1u << i));
    wiring.resolution[i] = std::abs(card.wiring.axes[i].scale);
  }

  return options;
}

}  // namespace abbe::daemon
