#include "abbe/config/touch_options.hpp"
#include "message_bounds.hpp"
#include "plausible.hpp"
#include "readers.hpp"

namespace abbe::daemon {

namespace {

void read_delay(Section& probe, drivers::ProbeDelay& out) {
  probe.get_integer("id", out.id, 0, 1'000'000'000);
  probe.get("delay_us", out.delay, kMicro, kNotNegative);
  probe.get("jitter_us", out.u_jitter, kMicro, kNotNegative);
  probe.get("u_delay_us", out.u_delay, kMicro, kNotNegative);
}

void read_approach(Section& probe, drivers::ProbeApproach& out) {
  probe.get("min_speed_mm_s", out.min_speed_m_s, kMilli, kNotNegative);
  probe.get("max_speed_mm_s", out.max_speed_m_s, kMilli, kPositive);
  probe.get("max_speed_change", out.max_speed_change, kPlain, kPositive);
  probe.get("speed_window_ms", out.speed_window, kMilli, kPositive);
}

void read_switching(Section& probe, drivers::ProbeSwitching& out) {
  probe.get("confirm_ms", out.confirm, kMilli, kPositive);
  probe.get("chatter_ms", out.chatter, kMilli, kNotNegative);
  probe.get("rearm_ms", out.rearm_quiet, kMilli, kNotNegative);
  probe.get("rearm_retract_um", out.rearm_retract_m, kMicro, kNotNegative);
}

}  // namespace

void read_probe(Section& root, Config& out, StreamNames& names) {
  Section probe = root.child("probe");
  if (!probe.present()) return;
  ProbeConfig config;
  get_bounded(probe, "name", config.name, bound_of<v1::ProbeTrigger>("device"));
  read_delay(probe, config.delay);
  read_approach(probe, config.approach);
  read_switching(probe, config.switching);
  probe.get("window_before_ms", config.window_before, kMilli, kNotNegative);
  probe.get("window_after_ms", config.window_after, kMilli, kNotNegative);
  const bool wired = out.counter_card && (out.counter_card->wiring.latch_channel ||
                                          out.counter_card->wiring.edge_channel);

  if (!wired) {
    probe.fault("", "needs [counter_card] with a latch_channel or an edge_channel");
  } else if (drivers::check(out.counter_card->wiring)) {  // else the wiring has a fault already
    const auto valid = drivers::check(touch_options(config, *out.counter_card, out.machine));
    if (!valid) probe.fault("", valid.error().text);
  }

  probe.close();
  names.take(config.name, probe);
  out.probe = std::move(config);
}

}  // namespace abbe::daemon
