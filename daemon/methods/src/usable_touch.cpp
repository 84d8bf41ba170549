#include "usable_touch.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include "abbe/config/capabilities.hpp"
#include "abbe/config/linear_axes.hpp"
#include "abbe/pipeline/axis_zero.hpp"

namespace abbe::daemon {

std::string_view touch_fault(const protocol::Snapshot& touch) {
  using protocol::TouchFlag;
  const auto flags = touch.trigger.touch_flags;
  static constexpr std::array<std::pair<TouchFlag, std::string_view>, 6> kFaults{
      {{TouchFlag::NoPosition, "it has no position, because scans around it were lost"},
       {TouchFlag::Refused, "the measuring machine reported a warning for it"},
       {TouchFlag::SpeedTooLow, "the approach was slower than the probe is qualified for"},
       {TouchFlag::SpeedTooHigh, "the approach was faster than the probe is qualified for"},
       {TouchFlag::SpeedUnsteady, "the speed of the approach changed"},
       {TouchFlag::LatchRefused, "the latched clock count is not within its scan interval"}}};

  for (const auto& [flag, text] : kFaults) {
    if (has(flags, flag)) return text;
  }

  if (!has_linear_axes(touch)) return "an axis was not known";
  return {};
}

TouchRules touch_rules(const Config& config) {
  TouchRules rules{.longest_pause = config.evemu.longest_pause};
  const auto touches = touch_source(config);
  if (touches) rules.device = touches->device;
  const auto counted = counted_axes(config);
  rules.zero_is_lost_by_restart = touches && !touches->reports_positions && counted &&
                                  std::ranges::any_of(counted->axes(), [&config](const auto& axis) {
                                    return !has_marks(config, axis.name);
                                  });
  return rules;
}

}  // namespace abbe::daemon
