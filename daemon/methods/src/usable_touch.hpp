#pragma once
/// The conditions that every method with a touch probe requires of a touch and of the axes.

#include <string_view>

#include "abbe/config/config.hpp"
#include "abbe/methods/touch_intake.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::daemon {

/// The reason why the touch cannot be used; empty if it can be used.
[[nodiscard]] std::string_view touch_fault(const protocol::Snapshot& touch);

/// The rules of the configuration: device, longest pause, loss of the zero. If the operator has to
/// state the zero again, it is only approximately the same as before, so it counts as lost.
[[nodiscard]] TouchRules touch_rules(const Config& config);

}  // namespace abbe::daemon
