#pragma once
/// What every method with a touch probe asks of a touch and of the axes.

#include <string_view>

#include "abbe/config/config.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::daemon {

/// Why the touch cannot be used; empty if it can be used.
[[nodiscard]] std::string_view touch_fault(const protocol::Snapshot& touch);

/// True if a restart of the touching device gives an axis another zero. Reference marks give an axis
/// the same zero again after the counters restarted. A zero that the operator states again is only
/// approximately the same, so it counts as lost.
[[nodiscard]] bool zero_is_lost_by_restart(const Config& config);

}  // namespace abbe::daemon
