#pragma once
/// The ball array: balls in an L on a plate with two blocks whose faces give it a direction.
/// [Li OMM] eqs. (11), (12): the uniform coordinate system has its origin in Ball1, z along the
/// normal of block 1, x along (normal of block 2) x z. Carried from the calibration of the artefact
/// to a position on the machine, it says where the balls should be; what the machine reads instead
/// is the error. Lengths in m.

#include <Eigen/Core>
#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/environment/thermal_expansion.hpp"
#include "abbe/calib/fit/plane.hpp"
#include "abbe/calib/fit/sphere.hpp"
#include "abbe/calib/geometry.hpp"

namespace abbe::calib::evemu {

struct Calibrator {
  struct Ball {
    int number = 0;
    Vector3 centre_m = Vector3::Zero();  ///< in the frame of the artefact's own calibration
    double radius_m = 0.0;
    double u_m = 0.0;  ///< standard uncertainty of the centre, per coordinate
  };
  struct Block {
    int number = 0;
    Vector3 normal = Vector3::UnitZ();  ///< outward
    double u_rad = 0.0;  ///< standard uncertainty of its direction, about each axis across it
  };
  struct Expansivity {
    double alpha_per_K = 0.0;
    double u_alpha_per_K = 0.0;
  };
  std::string name;
  double tip_radius_m = 0.0;
  std::vector<Ball> balls;                   ///< 1, 2, 3 ... in this order, at 20 C
  std::vector<Block> blocks;                 ///< 1 and 2
  std::optional<Expansivity> expansivity{};  ///< none: nobody says how it grows
};

/// BadInput / NotFinite / DegenerateGeometry: numbers that are not 1, 2, 3 .., fewer than 4 balls,
/// balls on a line, two balls in one place, other than two blocks, normals parallel.
[[nodiscard]] Result<void> check(const Calibrator&);

/// How warm the array is where it is touched.
struct ArtefactTemperature {
  double temperature_K = kReferenceTemperature_K;
  double u_temperature_K = 0.0;  ///< standard uncertainty
};

/// The array at a temperature: centres about Ball1, and radii; directions stay.
[[nodiscard]] Calibrator at_temperature(const Calibrator&, const Expansion&);

/// What is uncertain of the array itself, alike at all positions.
struct ArtefactUncertainty {
  std::vector<double> u_ball_m;          ///< of the centres, per coordinate, by ball
  std::array<double, 2> u_block_rad{};   ///< as Calibrator::Block::u_rad
  double cosine_between_blocks = 0.0;    ///< n1 . n2
  std::optional<Expansion> expansion{};  ///< none: the array counts as at 20 C
  /// Relative, of all its lengths: of the expansion.
  [[nodiscard]] double u_scale() const;
  /// Nothing is stated: the array counts as exact.
  [[nodiscard]] bool none() const;
};
[[nodiscard]] ArtefactUncertainty uncertainty_of(const Calibrator&,
                                                 const std::optional<Expansion>&);

enum class Feature { Ball, Block };

/// One probed point: the centre of the tip, machine coordinates.
struct Touch {
  int position = 0;
  Feature feature = Feature::Ball;
  int number = 0;
  Vector3 p_m = Vector3::Zero();
};

/// z along n1, x along n2 x z: columns of the rotation; origin Ball1. Maps uniform to measuring
/// coordinates. DegenerateGeometry for parallel normals.
[[nodiscard]] Result<RigidTransform> uniform_frame(const Vector3& ball1_m, const Vector3& n1,
                                                   const Vector3& n2);

/// The artefact as the machine saw it at one position.
struct SeenArtefact {
  int position = 0;
  std::vector<fit::Sphere> balls;
  std::vector<std::vector<Vector3>> ball_points_m;
  std::array<fit::Plane, 2> blocks{};
  std::array<std::vector<Vector3>, 2> block_points_m;
  RigidTransform T_self_uni;
  std::vector<Vector3> ideal_m;  ///< [Li OMM] eq. (12): where the balls should be
  /// When each ball was touched: mean index of its touches among all of the run, in the order they
  /// were given.
  std::vector<double> ball_index;
  std::array<double, 2> block_index{};  ///< the same of the blocks
};

/// A calibrator from touches of its own calibration (one position, on a good machine). `outward`:
/// roughly where the faces of the blocks look. Radii are those of the fits without the tip's.
/// Uncertainties are those of the residuals. Four touches of a ball and three of a block leave
/// none: `u_touch_m`, the standard uncertainty of a touch, takes their place, and
/// TooFewObservations says where it is missing.
[[nodiscard]] Result<Calibrator> precalibrated(std::string name, std::span<const Touch>,
                                               double tip_radius_m,
                                               const std::array<Vector3, 2>& outward,
                                               std::optional<double> u_touch_m = {});

}  // namespace abbe::calib::evemu
