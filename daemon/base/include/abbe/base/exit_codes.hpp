#pragma once
/// The exit codes of all programs, under the names of the daemon.

#include "abbe/protocol/exit_codes.hpp"

namespace abbe::daemon {

using protocol::exit_codes_text;
using protocol::ExitCode;
using protocol::ExitCodeLine;
using protocol::meaning_of;
using protocol::number;

}  // namespace abbe::daemon
