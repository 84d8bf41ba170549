#pragma once
/// Reasons of the gate that a person accepts for one identification, beside those of [gate] accept.

#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/config/config.hpp"

namespace abbe::daemon {

/// Adds `names` to [gate] accept of `config`. Usage for a name that is not one of
/// gate_conditions().
[[nodiscard]] Result<void> accept_also(const std::vector<std::string>& names, Config& config);

}  // namespace abbe::daemon
