#pragma once
/// Charts as SVG: a page with them prints without JavaScript. Pure.

#include <string>

#include "abbe/report/html_report.hpp"

namespace abbe::daemon {

/// A band that is narrower than this share of the height of the panel is hardly visible.
inline constexpr double kVisibleBand = 0.05;

/// An SVG element: curves with their bands (2 u, or low to high), a legend and axes. If all bands
/// of 2 u are narrower than kVisibleBand, a second panel below shows U = 2 u with a scale of its
/// own. Points that are not finite interrupt a curve. Each curve has its name and the numbers that
/// it shows in the attributes data-name, data-x, data-y and data-u (standard uncertainty).
[[nodiscard]] std::string svg(const LineChart& chart);

/// The outlines of the bars, filled down to 0, and the normal distribution.
[[nodiscard]] LineChart line_chart(const Histogram& histogram);
/// All vectors as one curve with a gap after each of them.
[[nodiscard]] LineChart line_chart(const VectorChart& chart);

}  // namespace abbe::daemon
