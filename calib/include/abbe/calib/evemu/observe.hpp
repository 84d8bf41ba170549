#pragma once
/// Stage one: touches of the ball array at several positions in, errors of the ball centres out. V
/// at a ball = where it should be - where it was read, relative to Ball1; evaluated at the reading.
/// Blocks and balls are touched with the machine's own errors. They turn the whole artefact at
/// position p by Theta_p, and move the centre of a sphere by D, not by V at the centre (a curved V
/// bends the sphere):
///     V_seen(ball i) = D_i(V) - D_1(V) - Theta_p(V) x (P_i - P_1),    both linear in V at the touched
///     points.
/// A rotation common to all positions cancels: no touch can see it ([Li OMM] does not mention it). With the
/// touched points at hand D and Theta are part of the design (design_rows.hpp); without, D_i = V(P_i) and
/// Theta is noise.

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/evemu/artefact.hpp"
#include "abbe/calib/evemu/scaled_design.hpp"
#include "abbe/calib/kinematic_chain.hpp"

namespace abbe::calib::evemu {

/// One row of three: V seen at a ball.
struct BallError {
  int position = 0;
  int ball = 0;
  Vector3 reading_m = Vector3::Zero();
  Vector3 V_m = Vector3::Zero();  ///< relative to Ball1: zero there
};

struct Machine {
  KinematicChain chain;
  /// tool reference point to tip, the same for all touches
  Vector3 tool_offset_m = Vector3::Zero();
};

struct ObserveOptions {
  int order = 3;
  /// Positions 1 .. this many must be there; [Li OMM] section 3 uses eight.
  int positions = 8;
  /// A sphere has 4 unknowns; one point more shows when something is wrong.
  std::size_t least_points_per_ball = 5;
  std::size_t least_points_per_block = 4;
  /// Fitted radius against calibrated radius + tip. Machine errors near 3 mm change it by 0.04 mm;
  /// the next size of precision ball is 1 mm or more away.
  double max_radius_mismatch_m = 0.2e-3;
  /// Ball centres against the calibrator's after the best rigid motion: errors near 3 mm leave
  /// 0.5 mm.
  double max_shape_mismatch_m = 3e-3;
  /// Measured against calibrated direction of a block, after the same rigid motion.
  double max_block_tilt_rad = 0.05;
  /// Ball1 stands still while the artefact turns about it; V is relative to it, so it must be one
  /// place.
  double max_ball1_shift_m = 1e-3;
  /// Smallest turn between two positions; less is the same position again.
  double least_turn_rad = 2e-3;
  /// Off the surface the others of a feature lie on. Machine errors near 3 mm bend a sphere by
  /// 0.4 mm.
  double max_off_surface_m = 1e-3;
  /// A touch farther than this from the surface through the others of its ball or face, which lie
  /// ten times better, is false; only where there are four touches for each unknown (16 on a ball,
  /// 12 on a face).
  double least_false_touch_m = 0.15e-3;
  /// Thinnest against largest extent of all balls. Below, the third axis is not tested.
  double least_thickness = 1e-3;
  /// Where the calibrator says how the array grows, and only there.
  std::optional<ArtefactTemperature> artefact_temperature{};
};

/// Where the direction of the artefact came from. Blocks: the machine itself measured it, a
/// rotation common to all positions is in V and nobody can tell. Independent: from something that
/// knows, such as a tracker.
enum class RotationOrigin { Blocks, Independent };

struct Observations {
  Machine machine;
  int order = 3;
  RotationOrigin rotation = RotationOrigin::Blocks;
  std::vector<BallError> rows;        ///< by position, then ball; every position has Ball1
  std::vector<SeenArtefact> seen;     ///< by position; empty when only errors were given
  Vector3 ball1_m = Vector3::Zero();  ///< mean reading
  std::optional<ArtefactUncertainty> artefact{};  ///< none when only errors were given
  /// Standard deviation of slow noise over that of a ball centre (noise.hpp); 0: none. solve()
  /// estimates it where it is 0.
  double slow_noise = 0.0;
  [[nodiscard]] std::size_t positions() const;
};

/// Everything wrong with the touches is said by position and number, and named: TooFewObservations
/// (points on a ball or block, a ball, block or position left out), BadInput (a ball touched under
/// two numbers, blocks swapped, a false touch, balls touched from below, calibrator of another
/// artefact or balls numbered differently, Ball1 moved, an artefact that was not turned; a
/// temperature without an expansivity, or one without the other), DegenerateGeometry (all balls in
/// one plane). Where the balls fit mirrored, renumbered or in another unit, the error says so. With
/// temperature and expansivity the array is taken as it is at that temperature.
[[nodiscard]] Result<Observations> observe(std::span<const Touch>, const Calibrator&,
                                           const Machine&, const ObserveOptions& = {});
/// One position alone, by the same rules; without a temperature at 20 C, whatever the calibrator
/// says.
[[nodiscard]] Result<SeenArtefact> see_artefact(int position, std::span<const Touch> touches_of_it,
                                                const Calibrator&, const ObserveOptions& = {});
/// The earlier position at which the artefact stood as it does now.
[[nodiscard]] std::optional<std::size_t> stands_as_at(const Matrix3& R_self_uni,
                                                      std::span<const Matrix3> before,
                                                      double least_turn_rad);

/// observe() from errors that were computed elsewhere; block rotations are then unknown. BadInput
/// also where reading + V makes an artefact of another shape at every position, and of one shape
/// with signs, axes or unit of V changed: the change that fits is named.
[[nodiscard]] Result<Observations> observe_errors(std::span<const BallError>, const Machine&,
                                                  RotationOrigin rotation = RotationOrigin::Blocks,
                                                  const ObserveOptions& = {});

}  // namespace abbe::calib::evemu
