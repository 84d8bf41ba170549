#pragma once
/// Calibration of a Multi-Feature Bar on a measuring machine by reversal (reversal.hpp), from its
/// touches to its points of interest with covariance. The bar lies along one axis of the machine.
/// Normal passes have the bar_z of the first measurement, reversed ones the opposite; the n-th
/// normal and the n-th reversed pass are one repeat. Every pass is of a clamping (position) of its
/// own. The side from which the holes are probed follows the machine: rods are touched from there.
///
/// Direction of the bar: mean of the poses that the touches of all passes show. The plan only
/// states where to look.
///
/// Positioning: a step gauge along the bar shows the error of the machine E_XX = true distance -
/// measured distance. The tip moves along the gauge from face to face; distances are measured along
/// the line through these touches, in all three axes. What is left of the angle between this line
/// and the gauge, which is not measured, is in the uncertainty. The line may be inclined to the
/// machine axis as the bar is. On a line beside that of the bar, the rotations of the machine
/// change E_XX by rotation times distance of the lines (Abbe error). Between the faces E_XX is
/// linear. Units: m, rad, K. Pure.

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/mfb/observe/observe.hpp"

namespace abbe::calib::mfb {

/// One face; all faces are touched from the same side.
struct GaugeFace {
  double distance_m = 0.0;          ///< from the first face, calibrated, at 20 degC
  std::vector<Vector3> readings_m;  ///< of the three axes, one or more runs
};
/// A gauge without u_alignment_rad is aligned within +-0.3 mm over its length, in both directions
/// across it.
inline constexpr double kGaugeAlignment_m = 0.3e-3;

struct StepGauge {
  std::string name;
  std::vector<GaugeFace> faces;  ///< ascending distances from 0
  double u_m = 0.0;              ///< of a distance: independent part
  double u_per_m = 0.0;          ///< and part in proportion to it, common to all
  std::optional<Expansivity> expansion;
  double temperature_K = kReferenceTemperature_K, u_temperature_K = 0.0;
  Vector3 origin_m = Vector3::Zero();       ///< centre of the tip at the first face, machine axes
  Vector3 tool_offset_m = Vector3::Zero();  ///< tool reference point to tip
  /// Standard uncertainty of the rotations of the machine along the bar, relative to hole 1.
  std::optional<double> u_rotation_rad;
  /// Standard uncertainty of each of the two angles between the gauge and the line of its touches.
  /// Three times this value is the most that the line of the touches may be from the bar. nullopt:
  /// kGaugeAlignment_m over its length.
  std::optional<double> u_alignment_rad;
};

/// Standard uncertainties of x of each point.
struct PositioningBudget {
  double repeats_m = 0.0;  ///< mean of the passes, with the factor of Student's t
  double gauge_m = 0.0;    ///< calibration, alignment, temperature and repeatability of the gauge
  double abbe_m = 0.0;     ///< rotations of the machine times distance of the lines
  double temperature_m = 0.0;  ///< of the bar
};

struct BarCalibration {
  Bar bar;  ///< the given one with calibrated points and covariance
  /// Standard deviation of the mean of the repeats, s / sqrt(n), with n - 1 degrees of freedom.
  std::vector<Vector3> u_repeats_m;
  std::size_t degrees_of_freedom = 0;
  double student_t95 = 0.0;  ///< half width of the 95 % interval of the mean: t95 u_repeats
  /// Standard uncertainty in `bar`: t95 / 1.96 u_repeats, so that 1.96 u is the 95 % interval, and
  /// in x with the other contributions.
  std::vector<Vector3> u_m;
  std::vector<PositioningBudget> positioning;
  std::vector<Vector3>
      machine_m;  ///< errors of the machine along the bar, in axes of a normal pass
  Vector3 direction = Vector3::UnitX();      ///< of the bar as measured, machine axes
  Vector3 gauge_beside_m = Vector3::Zero();  ///< line of the gauge from that of the bar, bar axes
  std::vector<std::string> notes;
};

/// Errors of check() and observe(), with the name of the measurement; errors of
/// calibrate_by_reversal(). BadInput: a bar that is planned more than 20 mrad from a machine axis
/// or not parallel in all passes, a position with two passes, two passes with the same readings; a
/// gauge with invalid values, one that does not reach over the bar, a run that does not fit the
/// others of its face, touches on a line that is not along the bar. NotApplicable: the gauge lies
/// more than 1 mm beside the bar and u_rotation_rad is absent. `notes` state what could not be
/// checked or does not fit.
[[nodiscard]] Result<BarCalibration> calibrate_bar(const Bar& nominal, const Plan& plan,
                                                   std::span<const PassTouches> touches,
                                                   const StepGauge& gauge,
                                                   const ObserveLimits& limits = {});

/// Direction of the bar in machine axes, along which a step gauge is put and touched. Errors as
/// above.
[[nodiscard]] Result<Vector3> direction_of_bar(const Bar& nominal, const Plan& plan,
                                               std::span<const PassTouches> touches,
                                               const ObserveLimits& limits = {});

/// Whether the touches of one pass show the bar as planned: the errors of observe(), for a bar that
/// lies turned, another bar, a wrong feature or too few touches. `touches`: of that measurement.
[[nodiscard]] Result<void> check_pass(const Bar& nominal, const Plan& plan, std::size_t measurement,
                                      const PassTouches& touches, const ObserveLimits& limits = {});

}  // namespace abbe::calib::mfb
