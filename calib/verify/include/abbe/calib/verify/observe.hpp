#pragma once
/// Stage one of a verification ([Li OMM] section 5.4): computes V_las, the volumetric error
/// measured with an independent instrument (a laser tracker with its reflector near the tool tip),
/// from scale readings and the points that the instrument measured there. The pose of the
/// instrument is known only from these points: its frame is fitted to the readings, and this
/// removes the best-fit rigid motion (six parameters) from V. V = actual - nominal at the scale
/// reading.
///
/// Several points that were measured at one position of the axes (shots) form one place, which has
/// their means. Errors that are common to the shots of a place do not average out: errors of the
/// machine between the nodes of a model, the seat of the reflector, the air on this beam. A place
/// with many shots therefore has the same weight as one with a single shot. Lengths in m. Pure;
/// allocates.

#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "abbe/calib/geometry/rigid_transform.hpp"

namespace abbe::calib::verify {

struct MeasuredPoint {
  Vector3 reading_m = Vector3::Zero();   ///< axis positions from the scales
  Vector3 measured_m = Vector3::Zero();  ///< measured point in the instrument's frame
};

/// Transformation of the measured points to machine coordinates.
/// - BestFit: by T_machine_tracker, which is fitted to the points.
/// - Machine: the axes of the instrument are already parallel to those of the machine; V keeps its
///   rotation and the unknown constant vector between reflector and axis positions.
enum class Frame { BestFit, Machine };

/// Result of observe(): one entry per place, in the order of the first shots.
struct Observations {
  Frame frame = Frame::BestFit;
  RigidTransform T_machine_tracker;
  std::vector<Vector3> readings_m;              ///< means of the shots
  std::vector<Vector3> measured_m;              ///< means of the shots, in the instrument's frame
  std::vector<Vector3> V_m;                     ///< V of each place: T measured - reading
  std::vector<std::vector<std::size_t>> shots;  ///< indices of the measured points of each place
  /// Standard deviation of a shot from the mean of its place (length of the vector), pooled over
  /// the places. nullopt: every place has one shot.
  std::optional<double> repeatability_m{};

  [[nodiscard]] std::size_t shot_count() const noexcept;
};

/// Largest distance of the scale readings of a shot from those of the first shot of its place; and
/// the limit of this distance relative to the extent of the points, for small machines. An axis
/// returns to its target within some um; an axis that is moved by hand returns within some tenths
/// of a millimetre.
inline constexpr double kSamePlace_m = 1e-3;
inline constexpr double kSamePlaceOfExtent = 1.0 / 500.0;

/// Largest permitted rms residual after the rigid fit, as a fraction of the extent of the points.
/// Errors of machines are smaller. Exchanged rows, coordinates in inches or a left-handed frame
/// give larger residuals.
inline constexpr double kMostLackOfFit = 0.01;

/// V of a model at a scale reading, m; nullopt where the model is not valid.
using ErrorsAt = std::function<std::optional<Vector3>(const Vector3& reading_m)>;

/// Computes V at all places. Errors: NotFinite; TooFewObservations for fewer than 4 places;
/// DegenerateGeometry if the places do not span a volume; AlignmentFailed if the residuals exceed
/// kMostLackOfFit (with Frame::Machine after subtraction of their mean); its text names the usual
/// mistakes whose correction makes the points fit. `errors_at`: decides between mistakes that fit
/// equally well without a model, such as two swapped axes and one reversed axis; may be empty.
[[nodiscard]] Result<Observations> observe(std::span<const MeasuredPoint>, Frame = Frame::BestFit,
                                           const ErrorsAt& errors_at = {});

/// Searches mistakes with which the points fit a model far better than as given, although the
/// points as given fit a rigid motion: two axes of the readings reversed, axes in another order, a
/// constant of all ranges, columns exchanged. Returns one text for each, such as "X and Y reversed
/// (readings): 3.4 um rms left, 76 um as given"; empty for correct points.
[[nodiscard]] std::vector<std::string> likely_mistakes(std::span<const MeasuredPoint>, Frame,
                                                       const ErrorsAt& errors_at);

}  // namespace abbe::calib::verify
