#pragma once
/// Check of an identification from files whose configuration has [[thermal]] (correction of the
/// readings for the temperature of the scales). The daemon applies a model to corrected readings. A
/// model identified from uncorrected readings contains the thermal expansion of the scales, which
/// would then be corrected twice.

#include <string_view>

#include "abbe/base/error.hpp"
#include "abbe/config/config.hpp"

namespace abbe::daemon {

/// BadInput if the configuration has [[thermal]] and the user has not stated (`corrected`) that the
/// readings of `what` ("the path") are corrected.
[[nodiscard]] Result<void> check_scales(std::string_view command, std::string_view what,
                                        const Config& config, bool corrected);

}  // namespace abbe::daemon
