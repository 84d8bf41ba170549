#include "abbe/config/kinds/measuring_machine.hpp"

#include <fmt/format.h>

#include "abbe/base/end_limits.hpp"
#include "config_kind.hpp"
#include "message_bounds.hpp"
#include "plausible.hpp"

namespace abbe::daemon {
namespace {

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
  cmm.get("command_timeout_s", config.command_timeout, kPlain,
          {0.01, std::chrono::duration<double>{kLongestMachineAnswer}.count()});
  cmm.get("motion_timeout_s", config.motion_timeout, kPlain, {0.1, 3600.0});

  if (const auto other = touch_source(out))
    cmm.fault("",
              fmt::format("touches come from [{0}] already: remove [{0}] or [cmm]", other->key));
  cmm.close();
  names.take(config.name, cmm);
  out.of<CmmConfig>() = std::move(config);
}

std::vector<std::string> cmm_summary(const Config& config) {
  const auto& cmm = config.of<CmmConfig>();
  if (!cmm) return {};
  return {fmt::format("{}:{}", cmm->host, cmm->port)};
}

std::string cmm_reading_text(const Config& config) {
  if (!cmm_reads_axes(config)) return {};
  return config.of<CmmConfig>()->axes_compensated ? "|cmm|compensated" : "|cmm|raw";
}

std::optional<AxisReadings> cmm_axes(const Config& config) {
  const auto& cmm = config.of<CmmConfig>();
  if (!cmm) return std::nullopt;
  return AxisReadings{
      .key = CmmConfig::kKind.key, .axes = {}, .compensated = cmm->axes_compensated};
}

std::optional<TouchSource> cmm_touches(const Config& config) {
  const auto& cmm = config.of<CmmConfig>();
  if (!cmm) return std::nullopt;
  return TouchSource{.key = CmmConfig::kKind.key,
                     .device = cmm->name,
                     .reports_positions = true,
                     .compensated = cmm->axes_compensated};
}

}  // namespace

const ConfigKind CmmConfig::kKind{.key = "cmm",
                                  .read = &read_cmm,
                                  .summary = &cmm_summary,
                                  .reading_text = &cmm_reading_text,
                                  .moves = true,
                                  .axes = &cmm_axes,
                                  .axes_if_no_other = true,
                                  .touches = &cmm_touches};

bool cmm_reads_axes(const Config& config) {
  return config.of<CmmConfig>() && !axes_have_own_device(config);
}

}  // namespace abbe::daemon
