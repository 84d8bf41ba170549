#pragma once
/// Calibration of a Multi-Feature Bar on a measuring machine by reversal (reversal.hpp): computes
/// its points of interest with covariance from its touches. The bar lies along one axis of the
/// machine. Normal passes have the bar_z of the first measurement, reversed passes the opposite
/// one; the n-th normal and the n-th reversed pass form one repeat. Every pass has a clamping
/// (position) of its own. The machine always probes the holes from the same side, and touches the
/// rods from there, too.
///
/// The direction of the bar is the mean of the poses computed from the touches of all passes. The
/// plan only gives approximate places.
///
/// Positioning: a step gauge along the bar determines the error of the machine E_XX = true distance
/// - measured distance. The tip moves along the gauge from face to face; distances are measured
/// along the line through these touches, in all three axes. The angle between this line and the
/// gauge is not measured; its effect is in the uncertainty. The line may be inclined to the machine
/// axis as the bar is. If the gauge lies beside the bar, the rotations of the machine change E_XX
/// by rotation times distance of the lines (Abbe error). Between the faces E_XX is linear. Units:
/// m, rad, K. Pure.

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/mfb/observe/observe.hpp"

namespace abbe::calib::mfb {

/// One face of the step gauge; all faces are touched from the same side.
struct GaugeFace {
  double distance_m = 0.0;          ///< distance from the first face, calibrated, at 20 degC
  std::vector<Vector3> readings_m;  ///< readings of the three axes, one or more runs
};
/// A gauge without u_alignment_rad is aligned within +-0.3 mm over its length, in both directions
/// across it.
inline constexpr double kGaugeAlignment_m = 0.3e-3;

struct StepGauge {
  std::string name;
  std::vector<GaugeFace> faces;  ///< ascending distances; the first is 0
  double u_m = 0.0;              ///< standard uncertainty of a distance: independent part
  double u_per_m = 0.0;          ///< relative part of this uncertainty, common to all distances
  std::optional<Expansivity> expansion;
  double temperature_K = kReferenceTemperature_K, u_temperature_K = 0.0;
  Vector3 origin_m = Vector3::Zero();       ///< centre of the tip at the first face, machine axes
  Vector3 tool_offset_m = Vector3::Zero();  ///< from the tool reference point to the tip
  /// Standard uncertainty of the rotations of the machine along the bar, relative to hole 1.
  std::optional<double> u_rotation_rad;
  /// Standard uncertainty of each of the two angles between the gauge and the line of its touches.
  /// The angle between this line and the bar may be at most three times this value. nullopt:
  /// kGaugeAlignment_m over its length.
  std::optional<double> u_alignment_rad;
};

/// Contributions to the standard uncertainty of x of each point.
struct PositioningBudget {
  double repeats_m = 0.0;  ///< mean of the passes, multiplied for Student's t
  double gauge_m = 0.0;    ///< calibration, alignment, temperature and repeatability of the gauge
  double abbe_m = 0.0;     ///< rotations of the machine times distance of the lines
  double temperature_m = 0.0;  ///< temperature of the bar
};

struct BarCalibration {
  Bar bar;  ///< the given bar with calibrated points and covariance
  /// Standard deviation of the mean of the repeats, s / sqrt(n), with n - 1 degrees of freedom.
  std::vector<Vector3> u_repeats_m;
  std::size_t degrees_of_freedom = 0;
  double student_t95 = 0.0;  ///< half width of the 95 % interval of the mean: t95 u_repeats
  /// Standard uncertainty of the points of `bar`: u = t95 / 1.96 u_repeats, so that 1.96 u is the
  /// half width of the 95 % interval. In x the other contributions are included.
  std::vector<Vector3> u_m;
  std::vector<PositioningBudget> positioning;
  std::vector<Vector3>
      machine_m;  ///< errors of the machine along the bar, in axes of a normal pass
  Vector3 direction = Vector3::UnitX();      ///< measured direction of the bar, machine axes
  Vector3 gauge_beside_m = Vector3::Zero();  ///< distance of the line of the gauge from that of the
                                             ///< bar, bar axes
  std::vector<std::string> notes;
};

/// Computes the calibration. Errors of check() and observe(), with the name of the measurement;
/// errors of calibrate_by_reversal(). BadInput: a bar that is planned more than 20 mrad from a
/// machine axis or not parallel in all passes, a position with two passes, two passes with the same
/// readings; a gauge with invalid values, one that does not reach over the bar, a run that does not
/// fit the others of its face, touches on a line that is not along the bar. NotApplicable: the
/// gauge lies more than 1 mm beside the bar and u_rotation_rad is absent. `notes` name data that
/// could not be checked or do not fit.
[[nodiscard]] Result<BarCalibration> calibrate_bar(const Bar& nominal, const Plan& plan,
                                                   std::span<const PassTouches> touches,
                                                   const StepGauge& gauge,
                                                   const ObserveLimits& limits = {});

/// Computes the direction of the bar in machine axes, along which the step gauge is then placed and
/// touched. Errors as calibrate_bar().
[[nodiscard]] Result<Vector3> direction_of_bar(const Bar& nominal, const Plan& plan,
                                               std::span<const PassTouches> touches,
                                               const ObserveLimits& limits = {});

/// Checks the touches of one pass against the plan. Returns the errors of observe(): a bar that
/// lies turned, another bar, a wrong feature or too few touches. `touches`: those of this
/// measurement.
[[nodiscard]] Result<void> check_pass(const Bar& nominal, const Plan& plan, std::size_t measurement,
                                      const PassTouches& touches, const ObserveLimits& limits = {});

}  // namespace abbe::calib::mfb
