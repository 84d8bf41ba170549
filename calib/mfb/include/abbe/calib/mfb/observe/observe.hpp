#pragma once
/// Stage one: computes deviations of the points of interest from their calibrated places, and their
/// derivatives by the errors of the machine ([Viprey 2016] eq. 9 to 12; docs/multi_feature_bar.md).
/// p, R: pose of the bar from the touches of the first pass of its position, J = -t,
///     delta_i = R^T (O_i,read - J - p) - O_i(T) - sag
///             = -sum_k D_ik n_k . R^T V(q_k, t) + pose, tool, drift + corrections of O_i + noise
/// D: derivative of O_i by a displacement of touch k along its normal n_k (points_of_interest.hpp),
/// computed at the touched centres of the tip; V: error of the machine at the reading q_k of the
/// touch. Rows are in bar axes. Units: m, rad.

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/geometry/table_basis.hpp"
#include "abbe/calib/mfb/run/measurement.hpp"

namespace abbe::calib::mfb {

/// Pose of the bar in one position: place of O_1 and bar axes, in machine axes.
struct BarPose {
  Vector3 origin_m = Vector3::Zero();
  Matrix3 axes = Matrix3::Identity();
};

struct PositionOfBar {
  std::string name;
  BarPose pose;  ///< pose at which the rows are linearised
  BarPose planned;
  Vector3 O_N_m = Vector3::Zero();  ///< last point of interest, bar axes
};

/// One pass along the bar.
struct PassObservation {
  std::size_t measurement = 0;      ///< index in the plan
  std::size_t position = 0;         ///< index in Observations::positions
  std::size_t tool = 0;             ///< index in the position; tool 0 has no unknown constants
  std::optional<std::size_t> pair;  ///< number of the pair in the position; nullopt: no drift
  bool second_of_pair = false;
  double temperature_K = kReferenceTemperature_K;
  std::vector<std::size_t> touched;  ///< index of each used touch in the fixed order
                                     ///< (nominal_touches())
  std::vector<Vector3> reading_m;    ///< reading of each used touch for the nominal bar at the pose
  std::vector<Vector3> normal;       ///< outward normal of each used touch, bar axes
  Eigen::VectorXd time;              ///< time of each used touch in units of the duration of a pass
  /// Derivatives of O_i in bar axes by a displacement of each used touch along its normal: 3N x
  /// used touches.
  Eigen::MatrixXd dO_dtouch;
  Eigen::VectorXd delta_m;  ///< deviations of the N points, 3N values, bar axes
};

struct Observations {
  Bar bar;
  Plan plan;
  TableBasis basis;
  std::vector<PositionOfBar> positions;
  std::vector<PassObservation> passes;
  std::vector<std::string> notes;
};

/// Limits of observe(). Touches that exceed them belong to another bar, feature or position.
struct ObserveLimits {
  double beside_plan_m = 5e-3;     ///< distance of O_1 from its planned place
  double beside_plan_rad = 20e-3;  ///< angle of the bar axes from the planned ones
  double radius_m = 0.2e-3;        ///< difference of the radius of a fitted hole or rod from the
                                   ///< nominal one
  double place_m = 2e-3;           ///< distance of a fitted feature from its nominal place in the
                                   ///< bar frame
  double calibrated_m = 0.5e-3;    ///< distance of O_i from its calibrated place in the bar frame
};

/// Computes the observations. `touches`: one PassTouches per measurement of the plan. Errors name
/// measurement, feature and k: those of check() for bar and plan; BadInput for a touch that the
/// pattern does not have, a repeated one, or a reading more than half a node spacing outside the
/// nodes; TooFewObservations; errors of points_of_interest(); NotApplicable for a bar that lies
/// turned, another bar, a wrong feature or a pose beside the plan. Pure.
[[nodiscard]] Result<Observations> observe(const Bar&, const Plan&, std::span<const PassTouches>,
                                           const MfbMachine&, const ObserveLimits& = {});

/// Observations for a plan that has not been measured: every touch of the pattern at the planned
/// poses, all deviations 0.
[[nodiscard]] Result<Observations> planned_observations(const Bar&, const Plan&, const MfbMachine&);

}  // namespace abbe::calib::mfb
