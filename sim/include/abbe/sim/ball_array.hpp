#pragma once
/// A ball array as it stands on a machine's table: nine balls in an L, two blocks whose faces give
/// it a direction; and the eight positions to which it is turned about its first ball. m, machine
/// coordinates, the true ones. Pure.

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

/// How the array is against what its file says: at 20 C and as stated, unless told otherwise.
struct ArrayState {
  double temperature_C = 20.0;
  double alpha_per_K = 0.0;  ///< 0: the file does not speak of it
  double u_alpha_per_K = 0.0;
  double u_ball_m = 0.0;     ///< of a centre, per coordinate
  double u_block_rad = 0.0;  ///< of the direction of a face, about each axis across it
  std::uint64_t seed = 1;
};
/// The array as it stands there: off what is stated by errors drawn with these uncertainties, and
/// as long as its temperature makes it.
[[nodiscard]] BallArray as_it_is(const BallArray& stated, const ArrayState& state);

/// calibrator.toml of the array as stated.
[[nodiscard]] std::string format_calibrator_toml(const BallArray& stated,
                                                 const ArrayState& state = {});

}  // namespace abbe::sim
