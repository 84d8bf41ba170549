#pragma once
/// Finds the roles of the measurements in the sequence of [Viprey 2016] from their geometry.

#include <array>
#include <vector>

#include "abbe/calib/mfb/observe/observe.hpp"

namespace abbe::calib::mfb {

/// Mean of the passes of one position with one tool.
struct Profile {
  std::vector<std::size_t> passes;
  Matrix3 axes = Matrix3::Identity();  ///< axes of the bar as columns
  Vector3 tool_m = Vector3::Zero();
  std::vector<Vector3> tip_m;      ///< place of the tip at each hole, in the order of `hole`
  std::vector<Vector3> on_axis_m;  ///< nominal place of each hole, projected on the bar axis x
  std::vector<std::size_t>
      hole;  ///< indices of the holes, ascending along the machine axis or along the bar
  std::vector<std::size_t> along;  ///< axes of the machine along which the bar extends, 1 or 2
};
[[nodiscard]] std::vector<Profile> profiles_of(const Observations&);

/// Two profiles and their difference, second minus first [m].
struct ProfilePair {
  std::size_t first = 0, second = 0;
  double difference_m = 0.0;
};

struct SequentialRoles {
  std::array<std::vector<std::size_t>, 3> along;  ///< profiles along X, Y, Z
  ProfilePair x_at_two_z, x_at_two_y;             ///< along X
  ProfilePair y_at_two_z, y_with_two_tools_x;     ///< along Y
  ProfilePair z_with_two_tools_x, z_with_two_tools_y;
  std::array<std::array<std::size_t, 2>, 3> diagonals{};  ///< in XY, XZ, YZ: slopes + and -
};
/// Finds the roles. NotApplicable: the text names the role that no measurement has.
[[nodiscard]] Result<SequentialRoles> roles_of(const std::vector<Profile>&);

}  // namespace abbe::calib::mfb
