#pragma once
/// The ball array: balls in an L on a plate, and two blocks whose faces define its orientation.
/// [Li OMM] eqs. (11), (12): the uniform coordinate system has its origin in Ball1, z along the
/// normal of block 1, x along (normal of block 2) x z. Through this system the ball centres of the
/// artefact's calibration are transformed to a position on the machine: these are the ideal
/// centres. Ideal centre minus measured centre is the error. Here a position (of the array) is one
/// of the orientations to which the array is turned about Ball1; a feature is a ball or a block.
/// Lengths in m.

#include <Eigen/Core>
#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/environment/thermal_expansion.hpp"
#include "abbe/calib/fit/plane.hpp"
#include "abbe/calib/fit/sphere.hpp"
#include "abbe/calib/geometry/rigid_transform.hpp"

namespace abbe::calib::evemu {

struct Calibrator {
  struct Ball {
    int number = 0;
    Vector3 centre_m = Vector3::Zero();  ///< in the frame of the artefact's calibration
    double radius_m = 0.0;
    double u_m = 0.0;  ///< standard uncertainty of the centre, per coordinate
  };
  struct Block {
    int number = 0;
    Vector3 normal = Vector3::UnitZ();  ///< outward normal
    double u_rad = 0.0;  ///< standard uncertainty of the direction, about each perpendicular axis
  };
  std::string name;
  double tip_radius_m = 0.0;
  std::vector<Ball> balls;                   ///< numbers 1, 2, 3 ... in this order; dimensions at
                                             ///< 20 C
  std::vector<Block> blocks;                 ///< numbers 1 and 2
  std::optional<Expansivity> expansivity{};  ///< nullopt: thermal expansion not stated
};

/// Checks a calibrator. BadInput, NotFinite or DegenerateGeometry: ball numbers are not 1, 2, 3 ..,
/// fewer than 4 balls, balls on a line, overlapping balls, not exactly two blocks, parallel
/// normals.
[[nodiscard]] Result<void> check(const Calibrator&);

/// Temperature of the array while it is touched.
struct ArtefactTemperature {
  double temperature_K = kReferenceTemperature_K;
  double u_temperature_K = 0.0;  ///< standard uncertainty
};

/// The array at a temperature: ball centres relative to Ball1 and radii are multiplied by the
/// expansion factor; directions do not change.
[[nodiscard]] Calibrator at_temperature(const Calibrator&, const Expansion&);

/// Uncertainties of the calibrated dimensions of the array. An error of the array is the same at
/// all positions to which the array is turned on the machine.
struct ArtefactUncertainty {
  std::vector<double> u_ball_m;          ///< standard uncertainty of the centre of each ball, per
                                         ///< coordinate
  std::array<double, 2> u_block_rad{};   ///< as Calibrator::Block::u_rad
  double cosine_between_blocks = 0.0;    ///< n1 . n2, n1 and n2: normals of the blocks
  std::optional<Expansion> expansion{};  ///< nullopt: the array is taken as at 20 C
  /// Relative standard uncertainty of all lengths of the array, from the thermal expansion.
  [[nodiscard]] double u_scale() const;
  /// True if every uncertainty is zero: the array is taken as exact.
  [[nodiscard]] bool none() const;
};
[[nodiscard]] ArtefactUncertainty uncertainty_of(const Calibrator&,
                                                 const std::optional<Expansion>&);

enum class Feature { Ball, Block };

/// One probed point: the centre of the stylus tip in machine coordinates.
struct Touch {
  int position = 0;
  Feature feature = Feature::Ball;
  int number = 0;
  Vector3 p_m = Vector3::Zero();
};

/// Returns the transform from the uniform coordinate system to the system in which the arguments
/// were measured. The columns of the rotation are the unit vectors x, y, z of the uniform system: z
/// along n1, x along n2 x z (n1, n2: normals of the blocks); the origin is Ball1.
/// DegenerateGeometry for parallel normals.
[[nodiscard]] Result<RigidTransform> uniform_frame(const Vector3& ball1_m, const Vector3& n1,
                                                   const Vector3& n2);

/// The artefact as the machine measured it at one position.
struct TouchedArtefact {
  int position = 0;
  std::vector<fit::Sphere> balls;
  std::vector<std::vector<Vector3>> ball_points_m;
  std::array<fit::Plane, 2> blocks{};
  std::array<std::vector<Vector3>, 2> block_points_m;
  RigidTransform T_self_uni;
  std::vector<Vector3> ideal_m;  ///< [Li OMM] eq. (12): ideal ball centres
  /// Time of each ball: mean index of its touches among all touches of the run, in the order in
  /// which they were given.
  std::vector<double> ball_index;
  std::array<double, 2> block_index{};  ///< time of each block, as `ball_index`
};

/// Computes a calibrator from touches of the artefact at one position on an accurate machine.
/// `outward`: approximate outward directions of the block faces. Ball radii are the fitted radii
/// minus the tip radius. Uncertainties are computed from the residuals of the fits. Four touches of
/// a ball or three of a block have no residuals: `u_touch_m`, the standard uncertainty of a touch,
/// is then used instead. TooFewObservations if `u_touch_m` is needed but not given.
[[nodiscard]] Result<Calibrator> precalibrated(std::string name, std::span<const Touch>,
                                               double tip_radius_m,
                                               const std::array<Vector3, 2>& outward,
                                               std::optional<double> u_touch_m = {});

}  // namespace abbe::calib::evemu
