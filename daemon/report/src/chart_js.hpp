#pragma once
#include <string_view>

namespace abbe::daemon {

/// Chart.js as one script (MIT licence, its notice inside), from the package libjs-chart.js;
/// embedded at build.
[[nodiscard]] std::string_view chart_js() noexcept;

}  // namespace abbe::daemon
