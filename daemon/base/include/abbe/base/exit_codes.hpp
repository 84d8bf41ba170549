#pragma once
/// The exit codes of all programs, defined in protocol, as names of this namespace.

#include "abbe/protocol/exit_codes.hpp"

namespace abbe::daemon {

using protocol::exit_codes_text;
using protocol::ExitCode;
using protocol::ExitCodeLine;
using protocol::meaning_of;
using protocol::number;

}  // namespace abbe::daemon
