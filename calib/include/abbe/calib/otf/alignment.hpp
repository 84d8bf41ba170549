#pragma once
/// Where the tracker stands, and which leg of the path each block was measured on. [Sanders 2023]
/// section 1.2.3. The rotation is a full one (no small angles); what the alignment absorbs of the
/// machine's errors is a rigid motion and is given back by the six rigid unknowns of the solution.

#include <cstddef>
#include <span>
#include <vector>

#include "abbe/calib/otf/blocks.hpp"
#include "abbe/calib/otf/polyline.hpp"

namespace abbe::calib::otf {

struct Alignment {
  RigidTransform T_machine_tracker;        ///< tracker frame to machine coordinates
  RigidTransform rough_T_machine_tracker;  ///< from start, end and centroid only
  std::vector<std::size_t> leg;            ///< of every block
  std::vector<bool> used;                  ///< usable and outside the corners
  int iterations = 0;
  double first_rms_m = 0.0;  ///< distance of the used blocks to the path, first and last iteration
  double last_rms_m = 0.0;
  double measured_length_m = 0.0;
  double path_length_m = 0.0;
};

/// Monotone assignment: leg 0 first, last leg last, stay or +1 from block to block, of least cost
/// distance^2 + direction_m^2 (1 - chord . d). The globally closest leg confuses legs that cross or
/// coincide. `points_m` are axis positions (target offset taken off); NaN stands for a lost block.
[[nodiscard]] Result<std::vector<std::size_t>> assign_legs(std::span<const Vector3> points_m,
                                                           const Path&, double direction_m);

/// Errors of check(Path). AlignmentFailed: the points do not fit this path (length, rms).
/// NotConverged: max_alignment_updates used up. Both name what they fit instead: the path driven
/// backwards, reflected, in another unit of length.
[[nodiscard]] Result<Alignment> align(const BlockSeries&, const Machine&, const Path&,
                                      const Options&);

}  // namespace abbe::calib::otf
