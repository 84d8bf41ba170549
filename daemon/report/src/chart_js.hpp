#pragma once
#include <string_view>

namespace abbe::daemon {

/// Chart.js as one script, including its MIT licence notice. From the package libjs-chart.js,
/// embedded at build time.
[[nodiscard]] std::string_view chart_js() noexcept;

}  // namespace abbe::daemon
