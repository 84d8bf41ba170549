#pragma once
/// Assigns standstills to the positions of the path, and computes the pose of the tracker. Both
/// sequences keep their order; a position may have no standstill and a standstill no position. The
/// first correspondences are found without a pose, by the distances between a few successive
/// points, which no pose changes. They give a first pose. The assignment with a pose minimises
///     sum over assigned pairs of (distance / tolerance)^2 + number of unassigned points,
/// and pose (best fit, [Kabsch 1976]) and assignment are repeated until neither changes. If several
/// standstills are at one position, the one with most samples is used. Pure.

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/internal/otf/samples/standstill.hpp"

namespace abbe::calib::otf {

/// A standstill that is not used for any position.
struct ExtraStandstill {
  std::size_t standstill = 0;
  Vector3 axis_position_m = Vector3::Zero();  ///< axis position of the machine during this
                                              ///< standstill
  std::optional<std::size_t> visited_again;   ///< position of the path at which it is; nullopt:
                                              ///< none
};

struct StandstillAssignment {
  RigidTransform T_machine_tracker;
  RigidTransform rough_T_machine_tracker;  ///< pose from the first correspondences
  /// Index of the standstill of every position; nullopt: none.
  std::vector<std::optional<std::size_t>> standstill_of;
  std::vector<std::size_t> missed;  ///< positions without a standstill
  std::vector<ExtraStandstill> extra;
  int iterations = 0;
  double rms_m = 0.0;  ///< rms distance between standstills and positions
  double farthest_m = 0.0;
  std::size_t farthest_position = 0;
};

/// Computes assignment and pose. Errors: those of check(Path). TooFewObservations for fewer than
/// four standstills. AlignmentFailed if standstills and positions do not match: too many left over
/// (StandstillOptions), or too far apart (Options::max_alignment_rms_m, max_alignment_distance_m).
/// The text names the first place where they differ, and a modified path that fits, if there is
/// one.
[[nodiscard]] Result<StandstillAssignment> assign_standstills(std::span<const Standstill>,
                                                              const Machine&, const Path&,
                                                              const Options&);

/// One sentence for each position without standstill and each standstill without position, at most
/// ten.
[[nodiscard]] std::vector<std::string> notes_of(const StandstillAssignment&,
                                                std::span<const Standstill>, const Path&);

}  // namespace abbe::calib::otf
