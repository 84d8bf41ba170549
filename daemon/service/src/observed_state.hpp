#pragma once
/// Reads the state that the journal follows.

#include "abbe/service/hub.hpp"
#include "abbe/service/state_observer.hpp"

namespace abbe::daemon {

/// Asks the hub and waits until it answers, at most Hub::kHangsAfter until it begins. `participant`
/// is empty, because the hub does not know it. Any thread except the hub's.
[[nodiscard]] Observed observed_state(Hub& hub);

}  // namespace abbe::daemon
