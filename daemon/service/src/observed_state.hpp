#pragma once
/// The state that the journal follows.

#include "abbe/service/hub.hpp"
#include "abbe/service/state_observer.hpp"

namespace abbe::daemon {

/// Waits until the hub answers, Hub::kHangsAfter for it to begin. `participant` is empty: the hub
/// does not know it. Any thread except the hub's.
[[nodiscard]] Observed observed_state(Hub& hub);

}  // namespace abbe::daemon
