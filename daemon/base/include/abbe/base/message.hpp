#pragma once
/// Messages of the programs for people, on stderr (the journal under systemd). Texts may come from
/// files, devices and the network: a character that is not visible is written as an escape, so that
/// a terminal cannot take it for a command.

#include <string_view>

#include "abbe/base/error.hpp"

namespace abbe::daemon {

/// Prints "PROGRAM: TEXT".
void print_message(std::string_view program, std::string_view text);

/// Prints the error as print_message(), and its details, one a line.
void print_error(std::string_view program, const Error& error);

}  // namespace abbe::daemon
