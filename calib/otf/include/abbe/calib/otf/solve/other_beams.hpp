#pragma once
/// Whether the noise of the points of a run agrees with beams from the stated place of the tracker.
/// Points that were exported in machine or station coordinates, and are taken for points in the
/// frame of the tracker, are weighted along wrong beams, and an offset of the ranges acts along
/// them.
///
/// The noise of a tracker is smallest along its beam and alike in all directions across it. The
/// difference d of the residuals of two consecutive segments of a leg, along the component c of a
/// row, contains noise and hardly any error of the machine. Its variance is
///     var d = c^T S c
/// with the mean covariance S over the volume, which is estimated by weighted least squares.

#include <optional>
#include <string_view>

#include "abbe/calib/otf/solve/solve.hpp"

namespace abbe::calib::otf {

/// Name of the reason, and of the option that accepts such a run: noise of the machine that is
/// alike in two directions and small in the third looks the same.
inline constexpr std::string_view kOtherBeams = "beams";

struct OtherBeams {
  /// In which the noise is smallest, frame of the points; one of both signs.
  Vector3 direction = Vector3::UnitX();
  double angle_rad = 0.0;                ///< rms angle to the stated beams
  double along_m = 0.0, across_m = 0.0;  ///< standard deviations of the differences of segments
};
/// The direction of the beams, where the noise contradicts the stated place of the tracker (the
/// origin of the frame of the points): in this direction it is smaller by a quarter or more than in
/// all others, which are alike, not by chance, and the stated beams are more than 45 degrees away.
/// nullopt: not contradicted, noise that states nothing of beams, or not a run on the fly. Pure.
[[nodiscard]] std::optional<OtherBeams> find_other_beams(const Observations&, const Solution&);

}  // namespace abbe::calib::otf
