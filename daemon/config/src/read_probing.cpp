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

void read_cmm(Section& root, Config& out, StreamNames& names) {
  Section cmm = root.child("cmm");
  if (!cmm.present()) return;
  CmmConfig config;
  get_bounded(cmm, "name", config.name, bound_of<v1::ProbeTrigger>("device"));
  get_host(cmm, "host", config.host, Need::Required);
  cmm.get_integer("port", config.port, 1, 65535);
  cmm.get("tool", config.tool);
  cmm.get("home", config.home);
  cmm.get_integer("probe", config.probe, 0, 1'000'000'000);
  cmm.get("u_position_um", config.u_position_m, kMicro, kPositive);
  cmm.get("axes_compensated", config.axes_compensated);
  cmm.get("command_timeout_s", config.command_timeout, kPlain, kPositive);
  cmm.get("motion_timeout_s", config.motion_timeout, kPlain, kPositive);

  if (out.probe) cmm.fault("", "touches come from [probe] already: remove [probe] or [cmm]");
  cmm.close();
  names.take(config.name, cmm);
  out.cmm = std::move(config);
}

}  // namespace abbe::daemon
