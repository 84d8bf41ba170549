#pragma once
/// Check of the orientation of the path. If the signs of two axes are reversed in the path file,
/// the path is the correct one rotated by 180 degrees about the third axis. If two columns are
/// exchanged and one sign is reversed, the path is rotated by 90 degrees. The alignment compensates
/// this rotation with a rotation of the tracker. The residuals then are the same as with the
/// correct path, but the identified errors belong to the wrong positions. This mistake can only be
/// found with further evidence: scale readings along the path, a levelled tracker, or the known
/// position of the tracker.

#include <optional>
#include <string_view>
#include <vector>

#include "abbe/calib/model/gate.hpp"
#include "abbe/calib/otf/run/run.hpp"

namespace abbe::calib::otf {

/// Entry in the configuration that permits a model without evidence of the orientation of the path.
inline constexpr std::string_view kPathOrientation = "path-orientation";

/// Rotations by multiples of 90 degrees about the axes, without the identity, after which the whole
/// path is still within the travel (tolerance 1 mm). If the result is empty, the travel alone
/// excludes a wrong orientation. Rotations by 180 degrees about X, Y, Z come first.
[[nodiscard]] std::vector<Matrix3> possible_rotations(const Path&, const MachineNodes&);

/// Compares the orientation of the path with the evidence. Adds a reason to the verdict if the
/// evidence contradicts the orientation. Also adds a reason if the evidence does not exclude all of
/// possible_rotations(); this becomes a note if OrientationEvidence::accepted is set.
void require_orientation(Verdict&, const Path&, const MachineNodes&, const Vector3& target_offset_m,
                         const RigidTransform& T_machine_tracker, const OrientationEvidence&);

}  // namespace abbe::calib::otf
