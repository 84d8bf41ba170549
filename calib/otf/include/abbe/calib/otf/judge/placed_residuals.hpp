#pragma once
/// Residuals of the rows of a run with their places on the path and in the volume, for the figures
/// of a report. Pure; allocates.

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "abbe/calib/otf/judge/judge.hpp"

namespace abbe::calib::otf {

/// Residuals of a held-out row that remain after removal of the best-fit rigid motion (judge.hpp).
struct HeldOutResidual {
  double no_compensation_m = 0.0;
  double candidate_m = 0.0;
};

struct PlacedResidual {
  /// Length of the path from its first vertex to the row [m].
  double way_m = 0.0;
  std::size_t leg = 0;             ///< as Observation::leg
  std::optional<double> time_s{};  ///< time of the row's segment, Observations::segment_s
  Vector3 axis_position_m = Vector3::Zero();
  std::size_t component = 0;  ///< as Observation::component
  double sigma_m = 1.0;       ///< standard uncertainty of the row
  double before_m = 0.0;      ///< as Residuals::before_m
  double after_m = 0.0;       ///< as Residuals::after_m
  std::optional<HeldOutResidual> held_out{};
};

/// One element per row, in row order. `residuals` must be those of these observations.
[[nodiscard]] std::vector<PlacedResidual> placed_residuals(const Observations&,
                                                           const Residuals& residuals);

/// Fills PlacedResidual::held_out of `runs`, one element per run, when it is given to judge().
/// `runs` must exist as long as the returned function is called.
[[nodiscard]] HeldOutRow held_out_into(std::span<std::vector<PlacedResidual>> runs);

}  // namespace abbe::calib::otf
