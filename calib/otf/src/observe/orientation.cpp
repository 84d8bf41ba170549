#include "abbe/calib/otf/observe/orientation.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <string>

#include "abbe/calib/geometry/usual_mistakes.hpp"
#include "abbe/calib/internal/base/message.hpp"

namespace abbe::calib::otf {
namespace {

constexpr double kTravelTolerance_m = 1e-3;

/// The 23 rotations that map axes to axes, without the identity: each row and column of R has one
/// entry 1 or -1, and the determinant is 1. The rotations by 180 degrees about X, Y and Z come
/// first.
const std::vector<Matrix3>& axis_rotations() {
  static const std::vector<Matrix3> all = [] {
    std::vector<Matrix3> turns;
    std::array<Eigen::Index, 3> from{0, 1, 2};
    do {
      for (const int signs : {6, 5, 3, 7, 1, 2, 4, 0}) {  // bit i: row i is negative
        Matrix3 R = Matrix3::Zero();
        for (Eigen::Index i = 0; i < 3; ++i) {
          R(i, from[static_cast<std::size_t>(i)]) = (signs >> i & 1) != 0 ? -1.0 : 1.0;
        }
        if (R.determinant() > 0.0 && !R.isIdentity()) {
          turns.push_back(R);
        }
      }
    } while (std::next_permutation(from.begin(), from.end()));
    return turns;
  }();

  return all;
}

/// Tolerance of the up direction, as the chord between two unit vectors (for small angles the angle
/// in rad). 10 degrees: the axes of a machine are closer to vertical or horizontal than this.
constexpr double kUpTolerance = 0.17;
/// Tolerance of the given tracker position, which may be measured with a tape.
constexpr double kPlaceTolerance_m = 0.5;

/// The axis about which R rotates by 180 degrees; nullopt if R is another rotation.
std::optional<Axis> half_turn_about(const Matrix3& R) {
  for (const Axis axis : kAllAxes) {
    const auto k = static_cast<Eigen::Index>(index(axis));
    if (R.isDiagonal() && R(k, k) > 0.0) {
      return axis;
    }
  }
  return std::nullopt;
}

/// Text for reading the columns x, y, z of the path file so that the path is rotated by R, such as
/// "(-y, x, z)".
std::string columns(const Matrix3& R) {
  std::string text;
  for (Eigen::Index i = 0; i < 3; ++i) {
    for (Eigen::Index k = 0; k < 3; ++k) {
      if (R(i, k) != 0.0) {
        text += message(text.empty() ? "" : ", ", R(i, k) < 0.0 ? "-" : "", "xyz"[k]);
      }
    }
  }
  return "(" + text + ")";
}

/// Joins the texts to a list: "A", "A or B", "A, B or C", "A, B, C or 4 others".
std::string list_of(std::vector<std::string> texts) {
  constexpr std::size_t kMost = 3;
  if (texts.size() > kMost + 1) {
    texts[kMost] = message(texts.size() - kMost, " others");
    texts.resize(kMost + 1);
  }
  std::string list;
  for (std::size_t i = 0; i < texts.size(); ++i) {
    if (i > 0) list += i + 1 < texts.size() ? ", " : " or ";
    list += texts[i];
  }
  return list;
}

/// Text that lists rotations: "turned by 180 degrees about X or Z (signs of the other two axes
/// reversed), or with x, y, z read as ...".
std::string list_of_turns(const std::vector<Matrix3>& turns) {
  std::vector<std::string> half, other;
  for (const Matrix3& R : turns) {
    const auto about = half_turn_about(R);
    about ? half.push_back(message(letter(*about))) : other.push_back(columns(R));
  }

  std::string text;
  if (!half.empty()) {
    text = message("turned by 180 degrees about ", list_of(half),
                   " (signs of the other two axes reversed)");
  }

  if (!other.empty()) {
    text +=
        message(half.empty() ? "" : ", or ", "with its columns (x, y, z) read as ", list_of(other));
  }

  return text;
}

/// Describes the rotation of the path after which `found` agrees with `given`.
std::string correction_text(const Vector3& found, const Vector3& given, double at_most) {
  for (const Matrix3& R : axis_rotations()) {
    if (!((R * found - given).norm() <= at_most)) {
      continue;
    }
    const auto about = half_turn_about(R);
    return about ? message("; they agree after a rotation of the path by 180 degrees about ",
                           letter(*about),
                           ": the signs of the other two axes are reversed in the path file")
                 : message("; they agree with the columns (x, y, z) of the path file read as ",
                           columns(R));
  }
  return "; check the evidence and the axes of the path file";
}

/// If `found` contradicts `given`, adds a reason to the verdict and returns false. Else removes
/// from `open` the rotations that this evidence excludes.
bool agrees(Verdict& verdict, std::vector<Matrix3>& open, const Vector3& found,
            const Vector3& given, double at_most, const std::string& what) {
  if (!((found - given).norm() <= at_most)) {
    verdict.refuse("orientation",
                   message("path orientation: ", what, correction_text(found, given, at_most)));
    return false;
  }
  const auto excluded = [&](const Matrix3& R) {
    return (R * found - given).norm() > 2.0 * at_most;
  };
  open.erase(std::remove_if(open.begin(), open.end(), excluded), open.end());
  return true;
}

bool agrees_with_up(Verdict& verdict, std::vector<Matrix3>& open,
                    const RigidTransform& T_machine_tracker, const Vector3& up) {
  const Vector3 found = T_machine_tracker.R.col(2);
  const double off_rad = 2.0 * std::asin(std::min(1.0, 0.5 * (found - up).norm()));
  return agrees(
      verdict, open, found, up, kUpTolerance,
      message("the z axis of the levelled tracker is ", 180.0 / std::numbers::pi * off_rad,
              " degrees off the up direction of the machine"));
}

/// agrees() for the position of the tracker. If the path is rotated about the origin of the axis
/// positions, the tracker, which measures targets at axis position + target offset, seems to rotate
/// about the target offset. Therefore this offset is subtracted from both tracker positions.
bool agrees_with_place(Verdict& verdict, std::vector<Matrix3>& open, const Vector3& found_m,
                       const Vector3& given_m, const Vector3& target_offset_m) {
  return agrees(verdict, open, found_m - target_offset_m, given_m - target_offset_m,
                kPlaceTolerance_m,
                message("the computed tracker position is ", (found_m - given_m).norm(),
                        " m from the given position"));
}

}  // namespace

std::vector<Matrix3> possible_rotations(const Path& path, const MachineNodes& nodes) {
  std::vector<Matrix3> possible;
  for (const Matrix3& R : axis_rotations()) {
    std::vector<Vector3> turned = path.vertices_m;
    for (Vector3& q : turned) q = R * q;
    if (outside_travel(turned, nodes, kTravelTolerance_m).empty()) possible.push_back(R);
  }
  return possible;
}

void require_orientation(Verdict& verdict, const Path& path, const MachineNodes& nodes,
                         const Vector3& target_offset_m, const RigidTransform& T_machine_tracker,
                         const OrientationEvidence& evidence) {
  std::vector<Matrix3> open = possible_rotations(path, nodes);
  if (evidence.scales_agree) open.clear();
  if (evidence.up && !agrees_with_up(verdict, open, T_machine_tracker, *evidence.up)) return;
  if (evidence.tracker_m && !agrees_with_place(verdict, open, T_machine_tracker.t_m,
                                               *evidence.tracker_m, target_offset_m))
    return;
  if (open.empty()) return;
  const std::string text = message("path orientation: the path file fits equally well ",
                                   list_of_turns(open), ", and no evidence excludes this");

  if (evidence.accepted) {
    verdict.notes.push_back(text);
  } else {
    verdict.refuse("orientation", message(text,
                                          "; give a recording with the scales, tracker.vertical or "
                                          "tracker.position_mm, or accept ",
                                          kPathOrientation));
  }
}

}  // namespace abbe::calib::otf
