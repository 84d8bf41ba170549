#pragma once
/// Readings from files under a configuration with [[thermal]]: the daemon applies a model to
/// readings corrected for the temperature of the scales, so a model of uncorrected ones holds what
/// the scales grew by, and it would be corrected twice.

#include <CLI/App.hpp>
#include <string_view>

#include "abbe/base/error.hpp"
#include "abbe/config/config.hpp"

namespace abbe::daemon {

/// --scales-corrected into `corrected`.
CLI::Option* add_scales_corrected(CLI::App& command, bool& corrected);

/// BadInput unless [[thermal]] is absent, or somebody says that what `what` names ("the path") is
/// corrected.
[[nodiscard]] Result<void> check_scales(std::string_view command, std::string_view what,
                                        const Config& config, bool corrected);

}  // namespace abbe::daemon
