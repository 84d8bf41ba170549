#pragma once
/// Plan of the touches for the calibration of a ball array on a machine that moves to commanded
/// positions, with the path to each touch. Balls are touched on their upper half, faces on a circle
/// and at its centre. Between two touches of a ball the tip stays 1.6 times as far from the ball's
/// centre as in contact: a straight path of up to 60 degrees around the ball is then free of
/// collision. Between two features the tip moves up, then across above all features, then down. The
/// path from the initial tip position begins in the same way, and the last path ends above all
/// features. Other objects on the table are not taken into account. Lengths in m. Pure.

#include <array>
#include <optional>
#include <vector>

#include "abbe/calib/evemu/run/artefact.hpp"
#include "abbe/calib/geometry/machine_touches.hpp"

namespace abbe::calib::evemu {

struct FaceToTouch {
  Vector3 centre_m = Vector3::Zero();
  double half_size_m = 5e-3;
};

struct ArtefactTouchOptions {
  std::size_t points_per_ball = 13;  ///< at least 5
  std::size_t points_per_face = 9;   ///< at least 4
  double clearance_m = 5e-3;  ///< from a face before contact, and above all features in travel
};

struct PlannedTouch : MachineTouch {
  Feature feature = Feature::Ball;
  int number = 0;
};

struct ArtefactPlan {
  std::vector<PlannedTouch> touches;
  std::vector<Vector3> leave_m;  ///< path after the last touch: off the surface, then above all
                                 ///< features
};

/// Plans the touches. `from_m`: initial position of the tip's centre. Up is the outward normal of
/// block 1. BadInput: too few points, or a ball above the tip; also the errors of check(nominal).
[[nodiscard]] Result<ArtefactPlan> plan_artefact_touches(const Calibrator& nominal,
                                                         const std::array<FaceToTouch, 2>& faces,
                                                         const Vector3& from_m,
                                                         const ArtefactTouchOptions& options);

/// The artefact in machine coordinates: every centre and every normal transformed.
[[nodiscard]] Calibrator moved(const Calibrator& calibrator,
                               const RigidTransform& T_machine_artefact);

/// The calibrator from touches of a machine with the position uncertainty `u_position_m`:
/// precalibrated(), with uncertainties enlarged by the machine error common to all touches of a
/// feature ([GUM] 5.1.2 eq. (10)): u for a centre, u / half size of the face for a direction. The
/// thermal expansion is copied from `nominal`. The machine must have measured the array at 20 C, or
/// have corrected the positions it reports to 20 C.
[[nodiscard]] Result<Calibrator> calibrated_artefact(const Calibrator& nominal,
                                                     const std::array<FaceToTouch, 2>& faces,
                                                     std::span<const Touch> touches,
                                                     double u_position_m);

}  // namespace abbe::calib::evemu
