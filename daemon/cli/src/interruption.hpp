#pragma once
/// Makes signals of the user, such as Ctrl-C, a flag: a command that waits polls the flag and ends
/// cleanly.

#include <initializer_list>

namespace abbe::daemon {

/// After this call the given signals do not end the process any more; they only make interrupted()
/// true.
void mark_interruptions(std::initializer_list<int> signals);
[[nodiscard]] bool interrupted();

}  // namespace abbe::daemon
