#pragma once
/// Stage two of a verification: computes the part of the measured error V_las that a model does not
/// compensate. [Li OMM] eqs. (20), (21):
///     V_residual = V_las - V_comp,   R_resmag = |V_residual| / |V_las|
/// V_comp: V of the model. R_resmag < 1: the model reduces the error. V_las and V_comp are
/// evaluated on a grid inside the validity volume of the model, relative to their value at an
/// origin (Ball1). V_las is interpolated linearly onto the grid.
///
/// The comparison is made twice: with the model as stated, and with the model after the small rigid
/// motion that fits it best to V_las. The rigid motion is necessary if the frame of the instrument
/// was fitted to the readings, which removes the rotation from V_las, and if the rotation of a
/// ball-array model is unknown. Works for any VolumetricModel. Lengths in m. Pure; allocates.

#include <cstddef>
#include <optional>
#include <vector>

#include "abbe/calib/model/model_comparison.hpp"
#include "abbe/calib/verify/observe.hpp"

namespace abbe::calib::verify {

struct Options {
  /// Position at which V is set to zero. Default: Ball1 for a ball-array model. Other models have
  /// no origin: the means of V_las and of the model are subtracted, and the rigid motion of the
  /// model includes a translation.
  std::optional<Vector3> origin_m{};
  /// Grid spacing per axis; the coordinates of the grid points are multiples of the spacing. 0:
  /// 1/20 of the extent of the validity volume.
  Vector3 step_m = Vector3::Zero();
  /// Grid points closer to the origin than this are left out, because |V| goes to zero near the
  /// origin and R_resmag, divided by |V_las|, is meaningless. Default: 1/10 of the diagonal of the
  /// validity volume.
  std::optional<double> least_distance_m{};
};

struct GridPoint {
  Vector3 q_m = Vector3::Zero();
  Vector3 V_las_m = Vector3::Zero();      ///< measured error relative to the origin
  Vector3 stated_m = Vector3::Zero();     ///< V of the model, relative to the origin
  Vector3 turned_m = Vector3::Zero();     ///< stated_m after the rigid motion of the model
  double R_stated = 0.0, R_turned = 0.0;  ///< the ratio R_resmag of both
};

/// Statistics of R_resmag as in [Li OMM] Table 4: percentiles are interpolated between order
/// statistics; the standard deviation is that of the sample.
struct RatioStatistics {
  std::size_t count = 0;
  double mean = 0.0, standard_deviation = 0.0;
  double min = 0.0, p25 = 0.0, median = 0.0, p75 = 0.0, max = 0.0;
  std::size_t above_1 = 0;  ///< number of ratios > 1: the model increases the error
};
[[nodiscard]] RatioStatistics ratio_statistics(std::vector<double> ratios);

struct Comparison {
  std::optional<Vector3> origin_m;
  Vector3 step_m = Vector3::Zero();
  double least_distance_m = 0.0;
  /// Indices of the places (see Observations) inside the validity volume, and the residual errors
  /// at these places without compensation (`before`) and with the model (`after`). From the errors
  /// before and from those after, the best-fit rigid motion of each is removed.
  std::vector<std::size_t> inside;
  std::vector<Vector3> residual_before_m, residual_after_m;
  VectorStatistics before, after;
  /// Estimate of the interpolation error of V_las: rms difference on the grid, relative to the
  /// origin, between the model and the model interpolated linearly from the measured points.
  /// R_resmag describes the model only if this error is small compared with the residual errors;
  /// see ratios_hold().
  double interpolation_rms_m = 0.0;
  std::vector<GridPoint> grid;
  Vector6 turned = Vector6::Zero();  ///< rigid motion of the model: shift [m] (0 with an origin),
                                     ///< rotation [rad]
  RatioStatistics R_stated, R_turned;
};

/// Effect of the model on the residual errors at the measured places inside its validity volume.
/// NotSeen: the effect is not significant.
enum class Effect { Better, NotSeen, Worse };

/// Compares the mean over the places of |residual_before_m|^2 - |residual_after_m|^2 with three
/// times the standard error of this mean (s / sqrt(n), [GUM] 4.2.3), n: number of places, however
/// many shots they have. NotSeen if the absolute value of the mean is smaller. The errors of
/// neighbouring places are correlated, so that this standard error is an underestimate.
[[nodiscard]] Effect effect_at_points(const Comparison&) noexcept;

/// Largest permitted interpolation error as a fraction of the residual rms at the measured points.
/// An interpolation error of a third of the rms increases the rms by 5 % (root sum of squares).
inline constexpr double kMostInterpolation = 1.0 / 3.0;

/// True if the interpolation error is at most kMostInterpolation times the residual rms after
/// compensation, or less than 1 nm.
[[nodiscard]] bool ratios_hold(const Comparison&) noexcept;

/// Compares at the measured places alone: inside, residuals, before, after. This corresponds to the
/// prediction of reference points in [Sanders 2023] section 2.2. NotApplicable: the model is not
/// valid for the tool. TooFewObservations: fewer than 4 measured places inside the validity volume.
[[nodiscard]] Result<Comparison> compare_at_points(const Observations&, const VolumetricModel&,
                                                   const Vector3& tool_offset_m);

/// Compares at the measured places and on the grid. NotApplicable: the model is not valid for the
/// tool. TooFewObservations: fewer than 4 measured places inside the validity volume, or fewer than
/// 4 grid points inside both the validity volume and the hull of the measured points.
/// DegenerateGeometry: the origin is outside the hull of the measured points, so that V at the
/// origin is not known. BadInput: the step gives more than a million grid points.
[[nodiscard]] Result<Comparison> compare(const Observations&, const VolumetricModel&,
                                         const Vector3& tool_offset_m, const Options& = {});

}  // namespace abbe::calib::verify
