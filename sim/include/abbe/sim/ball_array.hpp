#pragma once
/// A ball array on a machine's table: nine balls in an L shape, and two blocks whose faces define
/// the orientation of the array; and the eight positions into which the array is rotated about its
/// first ball. True values in machine coordinates, in m. Pure.

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace abbe::sim {

struct ArrayBall {
  Eigen::Vector3d centre_m = Eigen::Vector3d::Zero();
  double radius_m = 12.7e-3;
};
struct ArrayFace {
  Eigen::Vector3d centre_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  ///< outward
  /// vector from the centre to the middle of an edge
  Eigen::Vector3d half_1_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d half_2_m = Eigen::Vector3d::Zero();
};
struct BallArray {
  std::string name = "L array";
  /// balls in the frame of the array: the first ball is at the origin
  std::vector<ArrayBall> balls;
  std::array<ArrayFace, 2> faces;
  double tip_radius_m = 1e-3;
};

/// A typical array. We chose its dimensions, because the drawing in [Li OMM] has no numbers.
[[nodiscard]] BallArray reference_ball_array();
/// T_machine_array for the positions 1 to 8.
[[nodiscard]] std::vector<Eigen::Isometry3d> reference_positions();

/// Differences between the true array and its calibrator.toml. By default the array has 20 C and
/// does not differ.
struct ArrayState {
  double temperature_C = 20.0;
  double alpha_per_K = 0.0;  ///< thermal expansion; 0: calibrator.toml has no alpha keys
  double u_alpha_per_K = 0.0;
  double u_ball_m = 0.0;  ///< standard uncertainty of a ball centre, per coordinate
  /// standard uncertainty of a face's direction, about each axis in its plane
  double u_block_rad = 0.0;
  std::uint64_t seed = 1;
};
/// The true array: `stated` plus errors drawn with the uncertainties in `state`, expanded to the
/// temperature in `state`.
[[nodiscard]] BallArray true_array(const BallArray& stated, const ArrayState& state);

/// The text of calibrator.toml for the stated array.
[[nodiscard]] std::string format_calibrator_toml(const BallArray& stated,
                                                 const ArrayState& state = {});

}  // namespace abbe::sim
