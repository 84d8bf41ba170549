#pragma once
/// The values of abbed's answers that are drawn as curves.

#include <nlohmann/json.hpp>

#include "abbe/web/curve_history.hpp"

namespace abbe::web {

/// Positions [m or rad] of the answer to "live", in mm and degrees. `axes`: of the answer to
/// "status". An axis without a current position has a gap.
void add_positions(CurveHistory& curves, const nlohmann::json& axes,
                   const nlohmann::json& positions, CurveHistory::Clock::time_point now);

/// Temperatures, air, residuals of a running calibration and of the clocks of connected devices, of
/// the answer to "status". While no device is connected abbed repeats the last environment: nothing
/// is added.
void add_status(CurveHistory& curves, const nlohmann::json& status,
                CurveHistory::Clock::time_point now);

}  // namespace abbe::web
