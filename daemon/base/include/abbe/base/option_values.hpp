#pragma once
/// The check of all values of command line options and the units of their names, defined in
/// protocol, as names of this namespace.

#include "abbe/protocol/option_values.hpp"
#include "abbe/protocol/option_words.hpp"

namespace abbe::daemon {

using protocol::check_option_values;
using protocol::option_words;

}  // namespace abbe::daemon
