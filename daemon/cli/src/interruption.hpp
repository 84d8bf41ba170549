#pragma once
/// Signals of the user, such as Ctrl-C, as a flag: a command that waits polls it and ends cleanly.

#include <initializer_list>

namespace abbe::daemon {

/// From now on these signals only make interrupted() true.
void mark_interruptions(std::initializer_list<int> signals);
[[nodiscard]] bool interrupted();

}  // namespace abbe::daemon
