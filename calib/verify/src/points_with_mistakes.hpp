#pragma once
/// The usual mistakes (geometry/usual_mistakes.hpp) in scale readings and measured points.

#include <span>
#include <string>

#include "abbe/calib/verify/observe.hpp"

namespace abbe::calib::verify {

/// "; they fit with X and Y swapped (readings)" for points that do not fit a rigid motion. Empty if
/// no usual mistake explains them. Tests the shots: means of places mix rows that are in the wrong
/// order.
[[nodiscard]] std::string mistakes_that_fit(std::span<const MeasuredPoint>, Frame,
                                            const ErrorsAt& errors_at);

}  // namespace abbe::calib::verify
