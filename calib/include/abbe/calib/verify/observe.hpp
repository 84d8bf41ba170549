#pragma once
/// Stage one of a verification ([Li OMM] section 5.4): scale readings and what an independent
/// instrument (a laser tracker with its reflector near the tip) measured there, each in its own
/// frame, become V_las, the volumetric error as the instrument saw it. Nobody knows where the
/// tracker stands but through these points: fitted onto the readings, its frame takes the rigid
/// motion out of V that fits V best (six numbers). What is left is shape. V = actual - nominal at
/// the scale reading. Lengths in m. Pure; allocates.

#include <span>
#include <vector>

#include "abbe/calib/geometry.hpp"

namespace abbe::calib::verify {

struct MeasuredPoint {
  Vector3 reading_m = Vector3::Zero();   ///< axis positions
  Vector3 measured_m = Vector3::Zero();  ///< in the instrument's frame
};

/// BestFit: T from the points themselves. Machine: the instrument's axes are the machine's by other
/// means; V keeps its rotation, and the unknown constant between reflector and axis positions.
enum class Frame { BestFit, Machine };

/// In the order of the points.
struct Observations {
  Frame frame = Frame::BestFit;
  RigidTransform T_machine_tracker;
  std::vector<Vector3> readings_m;
  std::vector<Vector3> measured_m;  ///< as given, in the instrument's frame
  std::vector<Vector3> V_m;         ///< T measured - reading
};

/// What is left after a rigid fit, against the extent of the points: errors of machines stay below
/// a hundredth; mixed rows, inches or a left-handed frame do not.
inline constexpr double kMostLackOfFit = 0.01;

/// NotFinite, TooFewObservations (less than 4), DegenerateGeometry (no volume), AlignmentFailed
/// (kMostLackOfFit; with Frame::Machine after the best constant).
[[nodiscard]] Result<Observations> observe(std::span<const MeasuredPoint>, Frame = Frame::BestFit);

}  // namespace abbe::calib::verify
