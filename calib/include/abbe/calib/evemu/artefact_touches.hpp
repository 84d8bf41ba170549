#pragma once
/// Where to touch a ball array for its own calibration, on a machine that can be told where to go,
/// and the ways there. Balls are touched on their upper half, faces on a square. Between two
/// touches the tip stays 1.6 times as far from a ball's centre as in contact, so that a straight
/// way of up to 60 degrees around it is free; between two features it goes up first, across above
/// everything, then down. So it does from where it stands at first, and in the end it goes up. What
/// else stands on the table is not known here. m; pure.

#include <array>
#include <optional>
#include <vector>

#include "abbe/calib/evemu/artefact.hpp"

namespace abbe::calib::evemu {

struct FaceToTouch {
  Vector3 centre_m = Vector3::Zero();
  double half_size_m = 5e-3;
};

struct ArtefactTouchOptions {
  std::size_t points_per_ball = 13;  ///< at least 5
  std::size_t points_per_face = 9;   ///< at least 4
  double clearance_m = 5e-3;  ///< of the tip before a face, and of everything when it travels
};

struct PlannedTouch {
  Feature feature = Feature::Ball;
  int number = 0;
  std::vector<Vector3> way_m;      ///< centres of the tip, one after the other
  Vector3 at_m = Vector3::Zero();  ///< centre of the tip in contact
  Vector3 normal = Vector3::UnitZ();
};

struct ArtefactPlan {
  std::vector<PlannedTouch> touches;
  std::vector<Vector3> leave_m;  ///< after the last touch: off the surface, then above everything
};

/// `from_m`: where the tip stands. Up is the outward normal of block 1. BadInput: too few points, a
/// tip with a ball above it, or as check(nominal).
[[nodiscard]] Result<ArtefactPlan> plan_artefact_touches(const Calibrator& nominal,
                                                         const std::array<FaceToTouch, 2>& faces,
                                                         const Vector3& from_m,
                                                         const ArtefactTouchOptions& options);

/// The artefact where it stands: every centre and normal moved.
[[nodiscard]] Calibrator moved(const Calibrator& calibrator,
                               const RigidTransform& T_machine_artefact);

/// What the touches of a machine with the uncertainty `u_position_m` say: precalibrated(), its
/// uncertainties widened by what the machine adds to every touch alike ([GUM] 5.1.2 eq. (10)): u to
/// a centre, u over the half size of a face to its direction. How the array grows is nominal's. The
/// machine must have measured it at 20 C, or have corrected what it reports.
[[nodiscard]] Result<Calibrator> calibrated_artefact(const Calibrator& nominal,
                                                     const std::array<FaceToTouch, 2>& faces,
                                                     std::span<const Touch> touches,
                                                     double u_position_m);

}  // namespace abbe::calib::evemu
