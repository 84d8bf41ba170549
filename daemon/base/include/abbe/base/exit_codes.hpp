#pragma once
/// The exit codes of all programs. They are defined in protocol; this header makes their names
/// known in this namespace.

#include "abbe/protocol/exit_codes.hpp"

namespace abbe::daemon {

using protocol::exit_codes_text;
using protocol::ExitCode;
using protocol::ExitCodeLine;
using protocol::meaning_of;
using protocol::number;

}  // namespace abbe::daemon
