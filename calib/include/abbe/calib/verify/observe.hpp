#pragma once
/// Stage one of a verification ([Li OMM] section 5.4): computes V_las, the volumetric error
/// measured with an independent instrument (a laser tracker with its reflector near the tool tip),
/// from scale readings and the points that the instrument measured there. The pose of the
/// instrument is known only from these points: its frame is fitted to the readings, and this
/// removes the best-fit rigid motion (six parameters) from V. V = actual - nominal at the scale
/// reading. Lengths in m. Pure; allocates.

#include <span>
#include <vector>

#include "abbe/calib/geometry.hpp"

namespace abbe::calib::verify {

struct MeasuredPoint {
  Vector3 reading_m = Vector3::Zero();   ///< axis positions
  Vector3 measured_m = Vector3::Zero();  ///< in the instrument's frame
};

/// How the measured points are transformed to machine coordinates.
/// - BestFit: by T_machine_tracker, which is fitted to the points.
/// - Machine: the axes of the instrument are already parallel to those of the machine; V keeps its
///   rotation and the unknown constant vector between reflector and axis positions.
enum class Frame { BestFit, Machine };

/// In the order of the points.
struct Observations {
  Frame frame = Frame::BestFit;
  RigidTransform T_machine_tracker;
  std::vector<Vector3> readings_m;
  std::vector<Vector3> measured_m;  ///< as given, in the instrument's frame
  std::vector<Vector3> V_m;         ///< T measured - reading
};

/// Largest permitted rms residual after the rigid fit, as a fraction of the extent of the points.
/// Errors of machines are smaller. Exchanged rows, coordinates in inches or a left-handed frame
/// give larger residuals.
inline constexpr double kMostLackOfFit = 0.01;

/// Errors: NotFinite; TooFewObservations for fewer than 4 points; DegenerateGeometry if the points
/// do not span a volume; AlignmentFailed if the residuals exceed kMostLackOfFit (with
/// Frame::Machine after subtraction of their mean).
[[nodiscard]] Result<Observations> observe(std::span<const MeasuredPoint>, Frame = Frame::BestFit);

}  // namespace abbe::calib::verify
