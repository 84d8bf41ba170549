#pragma once
/// The check of all values of command line options, defined in protocol, as a name of this
/// namespace.

#include "abbe/protocol/option_values.hpp"

namespace abbe::daemon {

using protocol::check_option_values;

}  // namespace abbe::daemon
