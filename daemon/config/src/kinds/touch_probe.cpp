#include "abbe/config/kinds/touch_probe.hpp"

#include <fmt/format.h>

#include <cmath>
#include <cstdint>

#include "classified_section.hpp"
#include "config_kind.hpp"
#include "message_bounds.hpp"

namespace abbe::daemon {

namespace {

void read_delay(ClassifiedSection& probe, drivers::ProbeDelay& out) {
  probe.get_integer(operation("id"), out.id, 0, 1'000'000'000);
  probe.get(measurement("delay_us"), out.delay, kMicro, kNotNegative);
  probe.get(operation("jitter_us"), out.u_jitter, kMicro, kNotNegative);
  probe.get(operation("u_delay_us"), out.u_delay, kMicro, kNotNegative);
}

void read_approach(ClassifiedSection& probe, drivers::ProbeApproach& out) {
  probe.get(operation("min_speed_mm_s"), out.min_speed_m_s, kMilli, kNotNegative);
  probe.get(operation("max_speed_mm_s"), out.max_speed_m_s, kMilli, kPositive);
  probe.get(operation("max_speed_change"), out.max_speed_change, kPlain, kPositive);
  probe.get(operation("speed_window_ms"), out.speed_window, kMilli, kPositive);
}

void read_switching(ClassifiedSection& probe, drivers::ProbeSwitching& out) {
  probe.get(operation("confirm_ms"), out.confirm, kMilli, kPositive);
  probe.get(operation("chatter_ms"), out.chatter, kMilli, kNotNegative);
  probe.get(operation("rearm_ms"), out.rearm_quiet, kMilli, kNotNegative);
  probe.get(operation("rearm_retract_um"), out.rearm_retract_m, kMicro, kNotNegative);
}

/// True if the probe is wired to a channel of the counter card; otherwise its touches have no time.
bool is_wired(const std::optional<CountedAxes>& counted) {
  return counted && (counted->card.wiring.latch_channel || counted->card.wiring.edge_channel);
}

void read_probe(ClassifiedSection& root, Config& out, StreamNames& names) {
  ClassifiedSection probe = root.child("probe");
  if (!probe.present()) return;
  ProbeConfig config;
  get_bounded(probe, operation("name"), config.name, bound_of<v1::ProbeTrigger>("device"));
  read_delay(probe, config.delay);
  read_approach(probe, config.approach);
  read_switching(probe, config.switching);
  probe.get(operation("window_before_ms"), config.window_before, kMilli, kNotNegative);
  probe.get(operation("window_after_ms"), config.window_after, kMilli, kNotNegative);
  const auto counted = counted_axes(out);

  if (!is_wired(counted)) {
    probe.fault("", fmt::format("needs {} with a latch_channel or an edge_channel",
                                tables_with(Capability::CountedAxes)));
  } else if (drivers::check(counted->card.wiring)) {  // otherwise a fault of the wiring has already
                                                      // been added
    const auto valid = drivers::check(touch_options(config, counted->card.wiring, out.machine));
    if (!valid) probe.fault("", valid.error().text);
  }

  probe.close();
  names.take(config.name, probe);
  out.of<ProbeConfig>() = std::move(config);
}

std::vector<std::string> probe_summary(const Config& config) {
  const auto& probe = config.of<ProbeConfig>();
  const auto counted = counted_axes(config);
  if (!probe || !counted) return {};
  return {fmt::format("id {}, on {}", probe->delay.id, counted->key)};
}

std::optional<TouchSource> probe_touches(const Config& config) {
  const auto& probe = config.of<ProbeConfig>();
  if (!probe) return std::nullopt;
  return TouchSource{.key = ProbeConfig::kKind.key, .device = probe->name};
}

std::chrono::nanoseconds nanoseconds_of(double seconds) {
  return std::chrono::nanoseconds{std::llround(1e9 * seconds)};
}

}  // namespace

drivers::TouchOptions touch_options(const ProbeConfig& probe,
                                    const drivers::CounterCardWiring& card,
                                    const MachineConfig& machine) {
  drivers::TouchOptions options;
  options.delay = probe.delay;
  options.approach = probe.approach;
  options.switching = probe.switching;
  options.window_before = probe.window_before;
  options.window_after = probe.window_after;
  drivers::ProbeWiring& wiring = options.wiring;
  wiring.clock_hz = card.clock_hz;
  wiring.use_latch = card.latch_channel.has_value();
  wiring.scan_period = nanoseconds_of(1.0 / drivers::scan_rate_hz(card));

  // A debounce of microseconds only filters noise. A debounce longer than the chatter of the
  // contact passes only a touch that lasts, and thus replaces the confirmation by the driver.
  const auto& debounce = card.edge_debounce;
  const auto debounce_time = nanoseconds_of(drivers::quad08::kDebounce_s[debounce.time_code]);
  const bool confirms = card.edge_channel && debounce.enabled && !debounce.trigger_before_stable;
  if (confirms && debounce_time > probe.switching.chatter) wiring.counter_debounce = debounce_time;
  wiring.linear_axes = 0;

  for (std::size_t i = 0; i < card.axes.size(); ++i) {
    const AxisConfig* axis = machine.find_axis(card.axes[i].name);
    const bool linear = axis == nullptr || axis->kind == AxisKind::Linear;
    if (linear) wiring.linear_axes = static_cast<std::uint8_t>(wiring.linear_axes | (1u << i));
    wiring.resolution[i] = std::abs(card.axes[i].scale);
  }

  return options;
}

const ConfigKind ProbeConfig::kKind{
    .key = "probe", .read = &read_probe, .summary = &probe_summary, .touches = &probe_touches};

}  // namespace abbe::daemon
