#pragma once
/// What a model document keeps of the verdict on a run.

#include <string_view>

#include "abbe/calib/gate.hpp"
#include "abbe/model/model_document.hpp"

namespace abbe::daemon {

/// Without residuals. `held_out`: what was excluded from the fit, "legs", "positions" or "points".
[[nodiscard]] RunFigures run_figures(const calib::Verdict& verdict, std::string_view held_out);

}  // namespace abbe::daemon
