#include "abbe/config/kinds/measuring_machine.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "abbe/base/end_limits.hpp"
#include "classified_section.hpp"
#include "config_kind.hpp"
#include "message_bounds.hpp"
#include "plausible.hpp"

namespace abbe::daemon {
namespace {

/// Reads the corners of the volume. Adds a fault unless both corners or none are given, and each
/// coordinate of the upper corner is above that of the lower one.
void read_volume(ClassifiedSection& cmm, CmmConfig& config) {
  std::vector<double> min_m, max_m;
  const bool low = cmm.get(operation("volume_min_mm"), min_m, kMilli);
  const bool high = cmm.get(operation("volume_max_mm"), max_m, kMilli);
  if (!low && !high) return;
  MotionBox volume;
  if (min_m.size() != volume.min_m.size() || max_m.size() != volume.max_m.size())
    return cmm.fault("volume_min_mm",
                     "volume_min_mm and volume_max_mm must both be three numbers, x, y, z");
  std::ranges::copy(min_m, volume.min_m.begin());
  std::ranges::copy(max_m, volume.max_m.begin());
  for (std::size_t i = 0; i < volume.min_m.size(); ++i)
    if (!(volume.min_m[i] < volume.max_m[i]))
      return cmm.fault("volume_max_mm", "must be above volume_min_mm in each coordinate");
  config.volume = volume;
}

void read_cmm(ClassifiedSection& root, Config& out, StreamNames& names) {
  ClassifiedSection cmm = root.child("cmm");
  if (!cmm.present()) return;
  CmmConfig config;
  get_bounded(cmm, operation("name"), config.name, bound_of<v1::ProbeTrigger>("device"));
  get_host(cmm, operation("host"), config.host, Need::Required);
  cmm.get_integer(operation("port"), config.port, 1, 65535);
  // The reported position is the position of the tip of the tool, so its meaning depends on the
  // tool.
  const Role positions = axes_have_own_device(out) ? Role::Measurement : Role::Reading;
  cmm.get(Key{"tool", positions}, config.tool);
  cmm.get(operation("home"), config.home);
  cmm.get_integer(operation("probe"), config.probe, 0, 1'000'000'000);
  cmm.get(operation("u_position_um"), config.u_position_m, kMicro, kPositive);
  cmm.get(Key{"axes_compensated", positions}, config.axes_compensated);
  cmm.get(operation("command_timeout_s"), config.command_timeout, kPlain,
          {0.01, std::chrono::duration<double>{kLongestMachineAnswer}.count()});
  cmm.get(operation("motion_timeout_s"), config.motion_timeout, kPlain, {0.1, 3600.0});
  read_volume(cmm, config);

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

std::string former_cmm_text(const Config& config) {
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

std::optional<MotionSource> cmm_motion(const Config& config) {
  const auto& cmm = config.of<CmmConfig>();
  if (!cmm) return std::nullopt;
  return MotionSource{.key = CmmConfig::kKind.key, .device = cmm->name, .volume = cmm->volume};
}

}  // namespace

const ConfigKind CmmConfig::kKind{.key = "cmm",
                                  .read = &read_cmm,
                                  .summary = &cmm_summary,
                                  .former_text = &former_cmm_text,
                                  .motion = &cmm_motion,
                                  .axes = &cmm_axes,
                                  .axes_if_no_other = true,
                                  .touches = &cmm_touches};

bool cmm_reads_axes(const Config& config) {
  return config.of<CmmConfig>() && !axes_have_own_device(config);
}

}  // namespace abbe::daemon
