#pragma once
/// Alignment of a run: the pose of the tracker in the machine, and the leg of the path on which
/// each segment was measured. [Sanders 2023] section 1.2.3. The rotation is not approximated for
/// small angles. The alignment absorbs a rigid motion from the errors of the machine; the six rigid
/// unknowns of the solution estimate this motion.

#include <cstddef>
#include <span>
#include <vector>

#include "abbe/calib/otf/observe/segments.hpp"
#include "abbe/calib/otf/run/polyline.hpp"

namespace abbe::calib::otf {

struct Alignment {
  RigidTransform T_machine_tracker;        ///< tracker frame to machine coordinates
  RigidTransform rough_T_machine_tracker;  ///< from start, end and centroid of the path only
  std::vector<std::size_t> leg;            ///< leg of every segment
  std::vector<bool> used;                  ///< segment is usable and outside the corners
  int iterations = 0;
  double first_rms_m = 0.0;  ///< rms distance of the used segments to the path, first iteration
  double last_rms_m = 0.0;   ///< rms distance of the used segments to the path, last iteration
  double measured_length_m = 0.0;
  double path_length_m = 0.0;
};

/// Assigns each segment to a leg: the first segment to leg 0, the last segment to the last leg;
/// from one segment to the next the leg index stays or increases by 1. The assignment minimises the
/// sum over all segments of
///     distance^2 + direction_m^2 (1 - chord . d)
/// distance: segment to leg, chord: unit vector of the direction of travel at the segment, d: unit
/// vector of the leg. Taking the closest leg of each segment would confuse legs that cross or
/// coincide. `points_m` are axis positions (target offset subtracted); NaN marks a lost segment.
/// TooFewObservations if there are fewer segments than legs.
[[nodiscard]] Result<std::vector<std::size_t>> assign_legs(std::span<const Vector3> points_m,
                                                           const Path&, double direction_m);

/// Computes the alignment. Errors: those of check(Path); AlignmentFailed if the points do not fit
/// this path (length, rms); NotConverged after max_alignment_updates. The texts of the last two
/// name a modified path that fits, if there is one: driven backwards, reflected, in another unit of
/// length.
[[nodiscard]] Result<Alignment> align(const SegmentSeries&, const Machine&, const Path&,
                                      const Options&);

}  // namespace abbe::calib::otf
