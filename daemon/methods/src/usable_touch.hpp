#pragma once
/// What every method with a touch probe asks of a touch and of the axes.

#include <string_view>

#include "abbe/config/config.hpp"
#include "abbe/methods/touch_intake.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::daemon {

/// Why the touch cannot be used; empty if it can be used.
[[nodiscard]] std::string_view touch_fault(const protocol::Snapshot& touch);

/// Device, pause and loss of the zero from the configuration. A zero that the operator states again
/// is only approximately the same as before, so it counts as lost.
[[nodiscard]] TouchRules touch_rules(const Config& config);

}  // namespace abbe::daemon
