#pragma once
/// Stage one: computes errors of the ball centres from touches of the ball array at several
/// positions. V at a ball = ideal centre (artefact.hpp) - measured centre, minus the same
/// difference for Ball1. This V belongs to the scale reading at the measured centre. The machine
/// touches blocks and balls with its own errors. These errors rotate the whole artefact at position
/// p by Theta_p, and displace the centre of a fitted sphere by D, which differs from V at the
/// centre (a curved V deforms the sphere):
///     V_seen(ball i) = D_i(V) - D_1(V) - Theta_p(V) x (P_i - P_1)
/// D and Theta are linear in V at the touched points. A rotation common to all positions cancels:
/// touches cannot detect it ([Li OMM] does not mention this). If the touched points are available,
/// D and Theta are part of the design (design_rows.hpp). If only ball errors are given, D_i is
/// taken as V(P_i), and Theta is treated as noise.

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/evemu/run/artefact.hpp"
#include "abbe/calib/geometry/kinematic_chain.hpp"
#include "abbe/calib/geometry/scaled_design.hpp"

namespace abbe::calib::evemu {

/// One observation of three components: V observed at a ball.
struct BallError {
  int position = 0;
  int ball = 0;
  Vector3 reading_m = Vector3::Zero();
  Vector3 V_m = Vector3::Zero();  ///< relative to Ball1, zero for Ball1 itself
};

struct Machine {
  KinematicChain chain;
  /// tool reference point to tip, the same for all touches
  Vector3 tool_offset_m = Vector3::Zero();
};

struct ObserveOptions {
  int order = 3;
  /// Number of positions of the array. Touches are required at all positions 1 to this number; [Li
  /// OMM] section 3 uses eight.
  int positions = 8;
  /// A sphere has 4 unknowns; a fifth point is redundant and reveals a wrong touch.
  std::size_t least_points_per_ball = 5;
  std::size_t least_points_per_block = 4;
  /// Largest difference between fitted radius and calibrated radius + tip radius. Machine errors of
  /// about 3 mm change the radius by 0.04 mm; the next size of precision ball differs by 1 mm or
  /// more.
  double max_radius_mismatch_m = 0.2e-3;
  /// Largest distance between a measured and the calibrated ball centre after the best-fit rigid
  /// motion of all balls. Machine errors of about 3 mm leave distances of 0.5 mm.
  double max_shape_mismatch_m = 3e-3;
  /// Largest angle between measured and calibrated normal of a block, after the best-fit rigid
  /// motion of all balls.
  double max_block_tilt_rad = 0.05;
  /// Largest distance of a reading of Ball1 from the mean of its readings. Ball1 stays in place
  /// while the artefact is turned about it, because V is relative to Ball1.
  double max_ball1_shift_m = 1e-3;
  /// Smallest rotation between two positions of the array. Positions that differ by a smaller
  /// rotation count as one position.
  double least_turn_rad = 2e-3;
  /// Largest distance of a touch from the surface of its feature. Machine errors near 3 mm deform a
  /// sphere by 0.4 mm.
  double max_off_surface_m = 1e-3;
  /// A touch is false if it lies farther than this from the surface through the other touches of
  /// its ball or face, and the others lie ten times closer to it. Tested only with at least four
  /// touches for each unknown (16 on a ball, 12 on a face).
  double least_false_touch_m = 0.15e-3;
  /// Smallest ratio of thinnest to largest extent of all balls. Below it the array covers only a
  /// plane, and the errors in the third direction are not measured.
  double least_thickness = 1e-3;
  /// Temperature of the array. Required if the calibrator states the thermal expansion of the
  /// array; must be absent otherwise.
  std::optional<ArtefactTemperature> artefact_temperature{};
};

/// How the orientation of the artefact at each position was measured. Blocks: by the machine
/// itself, on the blocks; V may then contain a rotation common to all positions that cannot be
/// detected. Independent: by another instrument, such as a tracker.
enum class RotationOrigin { Blocks, Independent };

struct Observations {
  Machine machine;
  int order = 3;
  RotationOrigin rotation = RotationOrigin::Blocks;
  std::vector<BallError> rows;        ///< by position, then ball; every position has Ball1
  std::vector<TouchedArtefact> seen;  ///< by position; empty when only errors were given
  Vector3 ball1_m = Vector3::Zero();  ///< mean reading of Ball1
  std::optional<ArtefactUncertainty> artefact{};  ///< nullopt when only errors were given
  /// Standard deviation of slow noise divided by that of a ball centre (noise.hpp); 0: no slow
  /// noise given, solve() estimates it.
  double slow_noise = 0.0;
  [[nodiscard]] std::size_t positions() const;
};

/// Computes the observations from touches. An error text names the position and the number of the
/// feature. TooFewObservations: too few points on a ball or block; a ball, block or position left
/// out. BadInput: a ball touched under two numbers; blocks swapped; a false touch; balls touched
/// from below; the calibrator of another artefact, or balls numbered differently; Ball1 moved; an
/// artefact that was not turned between positions; a temperature without an expansivity, or an
/// expansivity without a temperature. DegenerateGeometry: all balls in one plane. If the balls fit
/// when they are mirrored, renumbered or in another unit, the error text states that. With
/// temperature and expansivity the array is taken as it is at that temperature.
[[nodiscard]] Result<Observations> observe(std::span<const Touch>, const Calibrator&,
                                           const Machine&, const ObserveOptions& = {});
/// Evaluates the touches of one position by the rules of observe(). Without a temperature the array
/// is taken as at 20 C, even if the calibrator states an expansivity.
[[nodiscard]] Result<TouchedArtefact> see_artefact(int position,
                                                   std::span<const Touch> touches_of_it,
                                                   const Calibrator&, const ObserveOptions& = {});
/// Index in `before` of the first orientation from which `R_self_uni` differs by a rotation of less
/// than `least_turn_rad`; nullopt if there is none. An orientation is the rotation from the uniform
/// frame of the artefact (artefact.hpp) to machine coordinates.
[[nodiscard]] std::optional<std::size_t> same_orientation_as(const Matrix3& R_self_uni,
                                                             std::span<const Matrix3> before,
                                                             double least_turn_rad);

/// observe() for ball errors that were computed elsewhere; how the machine's errors rotate the
/// blocks is then unknown. Also BadInput if the ball centres, reading + V, form a different shape
/// at every position, but the same shape at all positions when signs, axes or unit of V are
/// changed: the text names this change.
[[nodiscard]] Result<Observations> observe_errors(std::span<const BallError>, const Machine&,
                                                  RotationOrigin rotation = RotationOrigin::Blocks,
                                                  const ObserveOptions& = {});

}  // namespace abbe::calib::evemu
