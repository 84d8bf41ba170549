#pragma once
/// Predicts, before a run of on-the-fly calibration, the uncertainty of its model. The design
/// matrix of the run follows from path, feed and tracker alone, so that the covariance of the
/// adjustment (solve.hpp) is known without any measurement. For unbiased estimates this covariance
/// is the smallest possible one (Cramer-Rao bound):
///     CRB_rms = sqrt(trace(G Cov)),   G = mean over the volume of (P M B)^T (P M B)
/// M B: columns of the model at a place, P: removes the best-fit rigid motion of the volume.
/// Noise: white, as Noise states it, and an offset of all ranges with the prior
/// Noise::u_range_offset_m, which is one more unknown. Not contained: Noise::u_scale and
/// u_axis_scale, correlated noise (turbulence makes the errors several times larger), drift, and
/// errors of the machine between the nodes. Units: m, rad, s. Pure.

#include <array>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/geometry/error_parameters.hpp"
#include "abbe/calib/otf/run/run.hpp"

namespace abbe::calib::otf {

/// How the machine drives a path: straight legs with a trapezoidal speed and a stop at each vertex.
struct Drive {
  double feed_m_per_s = 2.5 / 60.0;
  double acceleration_m_per_s2 = 1.0;
  double dwell_s = 0.05;  ///< standstill before each leg
};

/// A run that has not been measured yet.
struct PlannedRun {
  Machine machine;
  Vector3 tracker_m = Vector3::Zero();  ///< centre of the tracker, machine coordinates
  Noise noise;
  Drive drive;
  double points_per_s = 500.0;  ///< point rate of the tracker
  /// As Options::backlash: the differences are additional unknowns of the prediction, and legs on
  /// which a direction of travel is not known are not used.
  TravelDependence backlash = TravelDependence::None;
};

/// Checks the run. BadInput for a feed, an acceleration, a point rate or a noise that is not
/// positive, a negative dwell, an axis with fewer than two nodes or a travel of less than 50 mm
/// (shorter legs give no observations because of Options::corner_m), or a tracker within 50 mm of
/// the volume in which the reflector moves. NotFinite for NaN.
[[nodiscard]] Result<void> check(const PlannedRun&);

/// Time of one leg without its dwell.
[[nodiscard]] double leg_duration_s(double length_m, const Drive&);
/// Time of a path, dwells before its legs included.
[[nodiscard]] double duration_s(const Path&, const Drive&);

struct TableUncertainty {
  std::string name;    ///< such as "EXX", or "EC0Y" for a squareness error
  double rms_u = 0.0;  ///< root mean square over the nodes, datum G2; m or rad
  double max_u = 0.0;
};

struct PlaceUncertainty {
  Vector3 axis_position_m = Vector3::Zero();
  double u_m = 0.0;  ///< standard uncertainty of V without the rigid motion: root of the trace of
                     ///< its covariance
};

struct Prediction {
  double rms_u_m = 0.0;  ///< CRB_rms over the grid of the nodes (at most 13 for each axis)
  double max_u_m = 0.0;  ///< largest value in `map`
  std::vector<TableUncertainty> tables;
  /// Uncertainties of the differences between directions of travel, by table. 100 um or urad
  /// (kUOfBacklash): the path does not determine them. The size of the differences is not
  /// predicted.
  std::vector<TableUncertainty> backlash;
  std::string unused;                 ///< legs that are not used because of backlash, or empty
  std::vector<PlaceUncertainty> map;  ///< kMapPlaces per axis, evenly spaced; z varies fastest
  /// Tables that a run with one target cannot determine
  /// (ParameterLayout::observable_with_one_target).
  std::vector<std::string> left_out;
  std::size_t observations = 0, unknowns = 0;
  std::size_t rank = 0;          ///< rank of the data
  std::size_t datum_defect = 0;  ///< number of combinations that the datum fixes
  double condition = 0.0;        ///< condition number of the column-scaled data
  double length_m = 0.0;
  double duration_s = 0.0;

  static constexpr std::size_t kMapPlaces = 5;
};

/// Predicts the uncertainties. The errors of check(PlannedRun) and check(Path, MachineNodes).
/// BadInput if the tracker is within 50 mm of the path. RankDeficient as check_observable()
/// (plan_observable.hpp). `row_points`: as Options::row_points.
[[nodiscard]] Result<Prediction> predict(const Path&, const PlannedRun&,
                                         std::size_t row_points = Options{}.row_points);

}  // namespace abbe::calib::otf
