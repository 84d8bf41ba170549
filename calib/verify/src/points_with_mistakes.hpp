#pragma once
/// Tests the usual mistakes (geometry/usual_mistakes.hpp) in the points of a verification.

#include <span>
#include <string>

#include "abbe/calib/verify/observe.hpp"

namespace abbe::calib::verify {

/// Tests the usual mistakes (geometry/usual_mistakes.hpp) in scale readings and measured points
/// that do not fit a rigid motion. Text such as "; they fit with X and Y swapped (readings)"; empty
/// if no usual mistake explains them. The single shots are tested, because the means of places
/// would mix rows that are in the wrong order.
[[nodiscard]] std::string mistakes_that_fit(std::span<const MeasuredPoint>, Frame,
                                            const ErrorsAt& errors_at);

}  // namespace abbe::calib::verify
