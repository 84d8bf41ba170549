#pragma once
/// Input of a run of on-the-fly calibration with a laser tracker ([Sanders 2023]): the machine, the
/// path it drives, the tracker's points and their noise, and the options of the evaluation. All
/// values in SI units. Noise model: white, Gaussian, independent between samples; sigma_range along
/// the beam, sigma_angle * range in both directions across it. Correlated noise (turbulence) is
/// detected in the residuals and increases the stated uncertainties.

#include <array>
#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "abbe/calib/geometry/axis_interpolation.hpp"
#include "abbe/calib/geometry/axis_table.hpp"
#include "abbe/calib/geometry/kinematic_chain.hpp"
#include "abbe/calib/geometry/rigid_transform.hpp"
#include "abbe/calib/geometry/table_basis.hpp"
#include "abbe/calib/otf/run/encoder_log.hpp"
#include "abbe/calib/otf/run/nest_options.hpp"
#include "abbe/calib/otf/run/smoothness_options.hpp"
#include "abbe/calib/otf/run/standstill_options.hpp"

namespace abbe::calib::otf {

struct Machine {
  KinematicChain chain;
  MachineNodes nodes;  ///< axis ranges, nodes, references
  /// vector from the tool reference point to the reflector centre in this run
  Vector3 target_offset_m = Vector3::Zero();
  /// Interpolation of the tables that are identified. A cubic reproduces
  /// smooth errors with a fraction of the error of linear tables, but needs a path that determines
  /// every node well.
  Interpolation interpolation = Interpolation::Linear;
};

/// Polyline of the path; a vertex is an axis position (scale readings) in m with an exact stop, a
/// leg is the straight line between two consecutive vertices. Start, end and centroid of the
/// path must not be on a line, because they determine the rough alignment. A leg shorter than twice
/// Options::corner_m is not used.
struct Path {
  std::vector<Vector3> vertices_m;
};

/// One sample of the tracker. A lost sample is either an entry with valid = false or a gap in
/// time_s.
struct TrackerObservation {
  /// Time of the tracker clock, strictly ascending. The origin is arbitrary, because only
  /// differences are used. Times since 1970 are rounded to multiples of 0.24 us.
  double time_s = 0.0;
  Vector3 p_tracker_m = Vector3::Zero();  ///< reflector centre, tracker frame; ignored if !valid
  bool valid = true;
};

struct Noise {
  double sigma_range_m = 2e-6;    ///< of one sample, along the beam
  double sigma_angle_rad = 3e-6;  ///< of one sample, across the beam, in both directions
  /// Relative standard uncertainty common to all ranges of the run (refractive index of the air).
  /// Residuals do not show such an error: its effect is a scale error of the whole machine.
  double u_scale = 0.0;
  /// Relative standard uncertainty of the length of the scales of X, Y, Z (temperature and thermal
  /// expansion), common to all readings of an axis. Residuals do not show an error of the scale
  /// length, because its effect is a positioning error of the axis.
  std::array<double, 3> u_axis_scale{};
  /// Standard uncertainty of the offset common to all ranges (home position, reflector). If
  /// positive, the adjustment estimates the offset with this prior. 0: the offset is not estimated.
  double u_range_offset_m = 0.0;
};

/// Evidence for the orientation of the path in the machine; see orientation.hpp.
struct OrientationEvidence {
  bool scales_agree = false;  ///< scale readings exist along the path and agree with it
  /// Direction of the z axis of a levelled tracker: unit vector in machine coordinates.
  std::optional<Vector3> up{};
  std::optional<Vector3> tracker_m{};  ///< tracker position, machine coordinates, within 0.5 m
  bool accepted = false;               ///< the configuration accepts a path without evidence
};

/// OnTheFly: the tracker measures during the motion; only components across the direction of travel
/// are used. Standstill: the machine stops at every vertex of the path; all three components of the
/// mean position of each standstill are used.
enum class Mode { OnTheFly, Standstill };
/// Returns "on-the-fly" or "standstill".
[[nodiscard]] std::string_view name(Mode);
/// The mode with this name; nullopt for any other text.
[[nodiscard]] std::optional<Mode> mode_named(std::string_view);

/// TwoStep: the alignment first, then one linear adjustment ([Sanders 2023]). The alignment absorbs
/// a rotation from the errors of the machine; its effect of second order remains: 0.025 um for
/// errors of 0.1 mm.
/// Simultaneous: alignment and errors together, by Gauss-Newton from the result of TwoStep
/// (simultaneous.hpp); correlated noise is prewhitened (prewhitening.hpp).
enum class Estimator { TwoStep, Simultaneous };
/// Name in files and messages: "two-step" or "simultaneous".
[[nodiscard]] std::string_view name(Estimator);
[[nodiscard]] std::optional<Estimator> estimator(std::string_view name);

enum class Stage { Observe, Align, Solve, Judge };
[[nodiscard]] std::string_view name(Stage);
/// Called in the calling thread with 0 <= fraction <= 1, ascending within a stage.
using Progress = std::function<void(Stage, double fraction)>;
/// Called in the calling thread between the steps of the computation. With a few hundred unknowns a
/// step takes at most one second. If it returns true, the computation ends with NotConverged.
using Stopped = std::function<bool()>;

struct Options {
  Mode mode = Mode::OnTheFly;
  StandstillOptions standstill;  ///< options of Mode::Standstill
  /// Estimator of Mode::OnTheFly; standstills are always adjusted by TwoStep.
  Estimator estimator = Estimator::Simultaneous;
  /// Dependence of the tables on the direction of travel. None: the tables are the mean of both
  /// directions, and backlash stays in the residuals. Backlash, Tables: the differences between
  /// both directions are estimated, too, one value per table or one per node (backlash.hpp).
  TravelDependence backlash = TravelDependence::None;
  /// Samples per segment mean. 100 samples are 0.2 s and 8.3 mm at 500 Hz and 2500 mm/min: small
  /// compared with nodes 50 mm apart.
  std::size_t segment_samples = 100;
  /// Points closer than this to an end of their leg are not used: there the assignment to a leg is
  /// uncertain and the machine accelerates. 10 mm also exceeds half the travel of a segment, so
  /// that no used segment extends over a corner.
  double corner_m = 0.010;
  /// Largest number of standstill samples at each end of the run. Their means are the measured
  /// first and last vertex. 20 samples are 40 ms at 500 Hz; samples of a machine that has left the
  /// vertex are not used.
  std::size_t standstill_samples = 20;
  /// Number of sub-points of a segment over which design rows are averaged. With 10 the result does
  /// not differ from that with all samples.
  std::size_t row_points = 10;
  /// Fine alignment: minimum and maximum number of updates. The iteration stops when the relative
  /// decrease of the rms distance to the path is less than the tolerance.
  int min_alignment_updates = 7;
  int max_alignment_updates = 200;
  double alignment_tolerance = 1e-6;
  /// Number of updates in which segments are assigned to legs. Later updates keep the assignment,
  /// because they change the alignment by um, while legs are mm apart.
  int leg_assignment_updates = 5;
  /// Weight of the direction of travel in the leg assignment, in m: (0.02 m)^2 (1 - cos) is added
  /// to the squared distance.
  double leg_direction_m = 0.02;
  /// Limits of the distance to the path after the alignment: rms of all segments, and maximum of
  /// one segment or of one end of the path. AlignmentFailed above them. The gate accepts errors up
  /// to 1 mm, and their rms is lower. With the path of another run the distances are centimetres;
  /// so are those of the last segments of a truncated path.
  double max_alignment_rms_m = 1e-3;
  double max_alignment_distance_m = 3e-3;
  /// AlignmentFailed if measured and nominal length of the path differ by more than this fraction.
  /// A measured length that is too short may be explained by beam breaks.
  double max_length_mismatch = 0.05;
  /// The iteration of Estimator::Simultaneous stops when an adjustment changes the estimate by less
  /// than this fraction of its standard uncertainty (root mean square over all combinations of the
  /// unknowns). Three adjustments are usual; the second already changes it by a fifth of the
  /// uncertainty only.
  double adjustment_tolerance = 1e-3;
  int max_adjustments = 10;
  /// Weight of the datum conditions in the adjustment (DatumOptions::weight). Any positive value
  /// gives the same solution (minimal constraints).
  double datum_weight = 1.0;
  /// Number of folds of the cross-validation; the observations are assigned to folds by leg.
  std::size_t held_out_folds = 5;
  OrientationEvidence orientation;
  /// Scale readings in addition to the tracker's points, for Mode::OnTheFly: identify() then also
  /// uses the component along the direction of travel (along_rows.hpp). Null: this component is not
  /// used. Must outlive the computation.
  const EncoderLog* encoders = nullptr;
  /// Reference nests that the tracker visits between the legs: the drift of the
  /// tracker is then estimated (tracker_drift.hpp).
  NestOptions nests{};
  /// Prior for smooth tables (smoothness.hpp), for every mode and estimator. Absent: no prior.
  std::optional<SmoothnessOptions> smoothness{};
  Progress progress;  ///< may be empty
  Stopped stopped;    ///< may be empty: the computation is never stopped
};

}  // namespace abbe::calib::otf
