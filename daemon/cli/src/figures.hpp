#pragma once
/// Statistics of vectors in the format of --json and as rows of a table.

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>

#include "abbe/base/units.hpp"
#include "abbe/calib/model/model_comparison.hpp"

namespace abbe::daemon {

[[nodiscard]] inline nlohmann::json vector_figures(const calib::VectorStatistics& s) {
  return {{"mean_um", s.mean_m * kUmPerM},
          {"rms_um", s.rms_m * kUmPerM},
          {"max_um", s.max_m * kUmPerM}};
}

/// `value` divided by 1 / `per_si` (one SI unit is `per_si` units of the result); null if there is
/// no value.
[[nodiscard]] inline nlohmann::json figure_or_null(double per_si,
                                                   const std::optional<double>& value) {
  return value ? nlohmann::json(per_si * *value) : nlohmann::json();
}

/// Widths of the columns.
struct VectorColumns {
  int name = 0, figure = 0;
};

[[nodiscard]] inline std::string vector_heading(std::string_view name, const VectorColumns& width) {
  return fmt::format("{:<{}}  {:>{}}  {:>{}}  {:>{}}", name, width.name, "mean", width.figure,
                     "rms", width.figure, "largest", width.figure);
}

/// The statistics as a row of the table, in um with three decimals.
[[nodiscard]] inline std::string vector_row(std::string_view name, const calib::VectorStatistics& s,
                                            const VectorColumns& width) {
  return fmt::format("{:<{}}  {:>{}.3f}  {:>{}.3f}  {:>{}.3f}", name, width.name,
                     kUmPerM * s.mean_m, width.figure, kUmPerM * s.rms_m, width.figure,
                     kUmPerM * s.max_m, width.figure);
}

}  // namespace abbe::daemon
