#pragma once
/// Stage two of a verification: how much of V_las a model leaves. [Li OMM] eqs. (20), (21):
/// V_residual = V_las - V_comp, R_resmag = |V_residual| / |V_las|, on a grid inside the model's
/// validity volume onto which V_las is interpolated linearly, both relative to their value at an
/// origin (Ball1). Below 1 the model helps. Twice: with the model as stated, and turned onto V_las
/// by the small rigid motion that fits best, because a frame fitted to the readings holds none of
/// V's rotation, and because the rotation of a ball-array model may be unknown. For any
/// VolumetricModel. Lengths in m. Pure; allocates.

#include <cstddef>
#include <optional>
#include <vector>

#include "abbe/calib/model_comparison.hpp"
#include "abbe/calib/verify/observe.hpp"

namespace abbe::calib::verify {

struct Options {
  /// Where V is set to zero. Default: Ball1 of a ball-array model; else nowhere: each side's mean
  /// is taken out, and the turned model may move, too.
  std::optional<Vector3> origin_m{};
  /// The grid is the multiples of this. 0: a twentieth of the extent of the validity volume, per
  /// axis.
  Vector3 step_m = Vector3::Zero();
  /// Nearer to the origin |V| goes to zero and the ratio says nothing. Default: a tenth of the
  /// diagonal of the validity volume.
  std::optional<double> least_distance_m{};
};

struct GridPoint {
  Vector3 q_m = Vector3::Zero();
  Vector3 V_las_m = Vector3::Zero();      ///< relative to the origin
  Vector3 stated_m = Vector3::Zero();     ///< the model there, relative to the origin
  Vector3 turned_m = Vector3::Zero();     ///< the same after the rigid motion
  double R_stated = 0.0, R_turned = 0.0;  ///< R_resmag
};

/// As [Li OMM] Table 4: percentiles interpolated between order statistics, standard deviation of
/// the sample.
struct RatioStatistics {
  std::size_t count = 0;
  double mean = 0.0, standard_deviation = 0.0;
  double min = 0.0, p25 = 0.0, median = 0.0, p75 = 0.0, max = 0.0;
  std::size_t above_1 = 0;  ///< made worse
};
[[nodiscard]] RatioStatistics ratio_statistics(std::vector<double> ratios);

struct Comparison {
  std::optional<Vector3> origin_m;
  Vector3 step_m = Vector3::Zero();
  double least_distance_m = 0.0;
  /// Which measured points lie inside the validity volume, and what is left there: without
  /// compensation, and with the model; each after its own best rigid motion, as both would be set
  /// up.
  std::vector<std::size_t> inside;
  std::vector<Vector3> left_before_m, left_after_m;
  VectorStatistics before, after;
  /// Linear interpolation of the model from the measured points against the model itself, on the
  /// grid and relative to the origin, rms: about what interpolating V_las costs. R_resmag says
  /// something of the model only where that is small against what is left: ratios_hold().
  double interpolation_rms_m = 0.0;
  std::vector<GridPoint> grid;
  Vector6 turned = Vector6::Zero();  ///< the model's motion: [m] (0 with an origin), rotation [rad]
  RatioStatistics R_stated, R_turned;
};

/// What the model does at the measured points inside its volume.
enum class Effect { Better, NotSeen, Worse };

/// From the mean over the points of |left_before|^2 - |left_after|^2, against three times its
/// standard error (s / sqrt(n), [GUM] 4.2.3); nearer to zero, the points show no effect.
/// Neighbouring points err alike, so that the standard error is rather too small.
[[nodiscard]] Effect effect_at_points(const Comparison&) noexcept;

/// Of the rms that is left at the points. A third of it adds 5 % in quadrature.
inline constexpr double kMostInterpolation = 1.0 / 3.0;

/// True: interpolation costs at most kMostInterpolation of what is left (or less than 1 nm).
[[nodiscard]] bool ratios_hold(const Comparison&) noexcept;

/// NotApplicable: the model does not hold for the tool. TooFewObservations: less than 4 measured
/// points inside the validity volume, or less than 4 grid points inside both it and the measured
/// points' hull. DegenerateGeometry: the origin is not between measured points, so nobody knows V
/// there. BadInput: a step that makes more than a million grid points.
[[nodiscard]] Result<Comparison> compare(const Observations&, const VolumetricModel&,
                                         const Vector3& tool_offset_m, const Options& = {});

}  // namespace abbe::calib::verify
