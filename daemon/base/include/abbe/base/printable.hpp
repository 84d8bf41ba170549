#pragma once
/// Text with escapes for what is not visible, defined in protocol, as names of this namespace.

#include "abbe/protocol/printable.hpp"

namespace abbe::daemon {

using protocol::printable;
using protocol::printable_line;

}  // namespace abbe::daemon
