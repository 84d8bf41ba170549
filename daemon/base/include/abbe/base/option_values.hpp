#pragma once
/// The check of the values of command line options, and the units in the names of options. They are
/// defined in protocol; this header makes their names known in this namespace.

#include "abbe/protocol/option_values.hpp"
#include "abbe/protocol/option_words.hpp"

namespace abbe::daemon {

using protocol::check_option_values;
using protocol::option_words;

}  // namespace abbe::daemon
