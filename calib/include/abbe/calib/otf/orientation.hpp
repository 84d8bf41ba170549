#pragma once
/// A path file in which the signs of two axes are reversed is the right one, turned by 180 degrees
/// about the third; one with two columns exchanged and a sign reversed is turned by 90 degrees. The
/// alignment takes the turn for a turn of the tracker: the residuals are those of the right path,
/// and the errors come out at the wrong places. Something besides the ranges and the path decides:
/// scales that were read along the path, a levelled tracker, or the place where the tracker stands.

#include <optional>
#include <string_view>
#include <vector>

#include "abbe/calib/gate.hpp"
#include "abbe/calib/otf/run.hpp"

namespace abbe::calib::otf {

/// The name under which a configuration lets a model pass without evidence of the path's
/// orientation.
inline constexpr std::string_view kPathOrientation = "path-orientation";

/// Rotations that map axes to axes, other than the identity, after which the path stays within the
/// travel (to 1 mm). None: the travel shows such an error of the file. Half turns about X, Y, Z
/// come first.
[[nodiscard]] std::vector<Matrix3> possible_turns(const Path&, const MachineNodes&);

/// What the evidence of `options` contradicts, as reasons that refuse the model, and which possible
/// turns it leaves open: that refuses the model, too, unless accepted by name (then it is a note).
void require_orientation(Verdict&, const Path&, const MachineNodes&, const Vector3& target_offset_m,
                         const RigidTransform& T_machine_tracker, const OrientationEvidence&);

}  // namespace abbe::calib::otf
