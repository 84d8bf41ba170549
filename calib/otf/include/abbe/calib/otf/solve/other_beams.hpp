#pragma once
/// Tests whether the noise of the points of a run agrees with beams from the stated place of the
/// tracker. The test detects points that were exported in machine or station coordinates and are
/// taken for points in the frame of the tracker. Such points would be weighted along wrong beams,
/// and an offset of the ranges would act along them.
///
/// The noise of a tracker is smallest along its beam and equal in all directions across it. The
/// difference d of the residuals of two consecutive segments of a leg, along the component c of a
/// row, contains noise and hardly any error of the machine. Its variance is
///     var d = c^T S c
/// with the mean covariance S over the volume, which is estimated by weighted least squares.

#include <optional>
#include <string_view>

#include "abbe/calib/otf/solve/solve.hpp"

namespace abbe::calib::otf {

/// Name of the reason, and of the option that accepts such a run. An option is necessary because
/// noise of the machine that is equal in two directions and small in the third has the same effect.
inline constexpr std::string_view kOtherBeams = "beams";

struct OtherBeams {
  /// Direction in which the noise is smallest, in the frame of the points; its sign is arbitrary.
  Vector3 direction = Vector3::UnitX();
  double angle_rad = 0.0;                ///< rms angle to the stated beams
  double along_m = 0.0, across_m = 0.0;  ///< standard deviations of the differences of segments
};
/// Computes the direction of the beams if the noise contradicts the stated place of the tracker
/// (the origin of the frame of the points). Conditions: in this direction the noise is
/// significantly smaller, by a quarter or more, than in all others; the noise in the others is
/// equal; and the stated beams are more than 45 degrees away. nullopt: no contradiction, noise
/// without such a direction, or not a run in on-the-fly mode. Pure.
[[nodiscard]] std::optional<OtherBeams> find_other_beams(const Observations&, const Solution&);

}  // namespace abbe::calib::otf
