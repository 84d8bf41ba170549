#pragma once
/// A ball array as it stands on a machine's table: nine balls in an L, two blocks whose faces give it a
/// direction; and the eight positions to which it is turned about its first ball. m, machine coordinates, the
/// true ones. Pure.

#include <Eigen/Geometry>
#include <array>
#include <string>
#include <vector>

namespace abbe::sim {

struct ArrayBall {
  Eigen::Vector3d centre_m = Eigen::Vector3d::Zero();
  double radius_m = 12.7e-3;
};
struct ArrayFace {
  Eigen::Vector3d centre_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();   ///< outward
  Eigen::Vector3d half_1_m = Eigen::Vector3d::Zero();  ///< from the centre to the middle of an edge
  Eigen::Vector3d half_2_m = Eigen::Vector3d::Zero();
};
struct BallArray {
  std::string name = "L array";
  std::vector<ArrayBall> balls;  ///< in its own frame: the first at the origin
  std::array<ArrayFace, 2> faces;
  double tip_radius_m = 1e-3;
};

/// Sizes and places are chosen: [Li OMM] prints a drawing without numbers.
[[nodiscard]] BallArray reference_ball_array();
/// T_machine_array of positions 1 to 8.
[[nodiscard]] std::vector<Eigen::Isometry3d> reference_positions();

/// calibrator.toml, as somebody measured it perfectly.
[[nodiscard]] std::string format_calibrator_toml(const BallArray& array);

}  // namespace abbe::sim
