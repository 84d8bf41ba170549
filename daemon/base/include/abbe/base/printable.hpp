#pragma once
/// Replaces characters that are not visible by escapes. Defined in protocol; this header makes the
/// names known in this namespace.

#include "abbe/protocol/printable.hpp"

namespace abbe::daemon {

using protocol::printable;
using protocol::printable_line;

}  // namespace abbe::daemon
