#pragma once
/// Signals of a person at work: whoever waits ends what it does in good order.

#include <initializer_list>

namespace abbe::daemon {

/// From now on these signals only make interrupted() true.
void mark_interruptions(std::initializer_list<int> signals);
[[nodiscard]] bool interrupted();

}  // namespace abbe::daemon
