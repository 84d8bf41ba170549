#pragma once
/// Messages of the programs for people, on stderr (the journal under systemd). Texts may come from
/// files, devices and the network. A character that is not visible is therefore written as an
/// escape, so that a terminal does not execute it as a control sequence.

#include <string_view>

#include "abbe/base/error.hpp"

namespace abbe::daemon {

/// Prints "PROGRAM: TEXT".
void print_message(std::string_view program, std::string_view text);

/// Prints the error in the form of print_message(), followed by its details, one per line.
void print_error(std::string_view program, const Error& error);

}  // namespace abbe::daemon
