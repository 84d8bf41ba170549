#pragma once
/// The reader of one table of a TOML file. It is defined in sections; this header makes the names
/// known in this namespace.

#include "abbe/base/faults.hpp"
#include "abbe/sections/section.hpp"

namespace abbe::daemon {

using sections::Bounds;
using sections::kAny;
using sections::kMicro;
using sections::kMilli;
using sections::kNano;
using sections::kNotNegative;
using sections::kPlain;
using sections::kPositive;
using sections::Need;
using sections::Origin;
using sections::Section;
using sections::Unit;

}  // namespace abbe::daemon
