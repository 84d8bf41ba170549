#pragma once
/// The configuration objects of Chart.js 3 for the charts of a report.

#include <nlohmann/json.hpp>

#include "abbe/report/html_report.hpp"

namespace abbe::daemon {

[[nodiscard]] nlohmann::json chart_configuration(const LineChart& chart);
[[nodiscard]] nlohmann::json chart_configuration(const Histogram& histogram);
[[nodiscard]] nlohmann::json chart_configuration(const VectorChart& chart);

}  // namespace abbe::daemon
