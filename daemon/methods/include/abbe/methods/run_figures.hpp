#pragma once
/// The part of a run that a model document contains: the verdict and the residuals of the fit.
/// Pure.

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/calib/model/gate.hpp"
#include "abbe/model/model_document.hpp"

namespace abbe::daemon {

/// The figures without residuals. `held_out`: what was excluded from the fit, "legs", "positions"
/// or "points".
[[nodiscard]] RunFigures run_figures(const calib::Verdict& verdict, std::string_view held_out);

/// Residual of one component of one observation.
struct RunResidual {
  std::size_t part = 0;          ///< index into the names of the parts
  std::optional<double> time_s;  ///< time from the beginning of the run
  double before_m = 0.0, after_m = 0.0;
  double sigma_m = 0.0;  ///< standard uncertainty; 0: not known
};

/// Adds the figures of each part, the series and the counts of all residuals. `residuals` is in the
/// order of the run. The series is over time if all residuals have a time. A residual that is not
/// finite and a part without residuals are left out. Of more than kMostParts parts, neighbours are
/// combined.
void add_residuals(RunFigures& run, std::string_view part_kind,
                   const std::vector<std::string>& part_names,
                   std::span<const RunResidual> residuals);
inline constexpr std::size_t kMostParts = 1000;

}  // namespace abbe::daemon
