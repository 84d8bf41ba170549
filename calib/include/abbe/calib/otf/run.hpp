#pragma once
/// What a run of on-the-fly calibration with a laser tracker ([Sanders 2023]) is made of: the
/// machine, the path it drove, the tracker's points, how noisy they are, and the choices of the
/// evaluation. All SI. Noise model: white, Gaussian, independent between samples; sigma_range along
/// the beam, sigma_angle * range in both directions across it. Correlated noise (turbulence) is
/// seen in the residuals and widens the stated uncertainties.

#include <array>
#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "abbe/calib/axis_table.hpp"
#include "abbe/calib/geometry.hpp"
#include "abbe/calib/kinematic_chain.hpp"

namespace abbe::calib::otf {

struct Machine {
  KinematicChain chain;
  MachineNodes nodes;  ///< axis ranges, nodes, references
  /// tool reference point to reflector centre, at this run
  Vector3 target_offset_m = Vector3::Zero();
};

/// Vertices of the polyline, axis positions (scale readings) in m, exact stop at each. Start, end
/// and centroid must not be on a line (the rough alignment stands on them), no leg shorter than
/// twice the corner exclusion is used.
struct Path {
  std::vector<Vector3> vertices_m;
};

/// One tick of the tracker. A lost tick may be an entry with valid = false or a hole in time_s.
struct TrackerObservation {
  double time_s = 0.0;  ///< tracker clock, strictly ascending; only its order and holes matter here
  Vector3 p_tracker_m = Vector3::Zero();  ///< reflector centre, tracker frame; ignored if !valid
  bool valid = true;
};

struct Noise {
  double sigma_range_m = 2e-6;    ///< along the beam, one sample
  double sigma_angle_rad = 3e-6;  ///< across the beam, both directions, one sample
  /// Relative standard uncertainty all ranges of the run have in common (index of the air). No
  /// residual shows it: it is a growth of the whole machine.
  double u_scale = 0.0;
  /// Relative standard uncertainty of the length of the scales of X, Y, Z (their temperature and
  /// expansion), in common for all readings of an axis. No residual shows it either: it is a
  /// positioning error.
  std::array<double, 3> u_axis_scale{};
  /// Standard uncertainty of the offset that all ranges have in common (home position, reflector).
  /// Positive: the adjustment estimates the offset, with this prior. 0: the ranges have none.
  double u_range_offset_m = 0.0;
};

/// What besides ranges and path decides how the path lies in the machine; see orientation.hpp.
struct OrientationEvidence {
  bool scales_agree = false;  ///< they were read along the path and agreed with it
  std::optional<Vector3>
      up{};  ///< unit vector, machine axes: where the z axis of a levelled tracker points
  std::optional<Vector3> tracker_m{};  ///< its place, machine coordinates, to 0.5 m
  bool accepted = false;               ///< without evidence, by name
};

enum class Stage { Observe, Align, Solve, Judge };
[[nodiscard]] std::string_view name(Stage);
/// Called in the calling thread with 0 <= fraction <= 1, ascending within a stage.
using Progress = std::function<void(Stage, double fraction)>;
/// Asked in the calling thread, between steps of a second at most where the model has some hundred
/// unknowns. True ends the computation with NotConverged.
using Stopped = std::function<bool()>;

struct Options {
  /// Samples per block mean. 100 samples are 0.2 s and 8.3 mm at 500 Hz and 2500 mm/min: fine
  /// against 50 mm nodes.
  std::size_t block_samples = 100;
  /// Points this close to the end of their leg are not used: mapping and dynamics are doubtful
  /// there. 10 mm also exceeds half the travel of a block, so that no used block straddles a
  /// corner.
  double corner_m = 0.010;
  /// Samples of standstill at both ends whose mean stands for the first and last vertex: 40 ms at
  /// 500 Hz.
  std::size_t standstill_samples = 20;
  /// Sub-points of a block over which design rows are averaged; 10 are indistinguishable from all.
  std::size_t row_points = 10;
  /// Fine alignment: at least, at most this many updates; stop when the rms falls relatively by
  /// less than the tolerance.
  int min_alignment_updates = 7;
  int max_alignment_updates = 200;
  double alignment_tolerance = 1e-6;
  /// Legs are assigned anew in the first iterations, then kept: the alignment settles to um, legs
  /// are mm apart.
  int leg_assignment_updates = 5;
  /// Weight of the direction of travel in the leg assignment, in m: (0.02 m)^2 (1 - cos) beside the
  /// squared distance.
  double leg_direction_m = 0.02;
  /// Alignment is refused if the rms distance to the path stays above the first, or one block or
  /// one end of the path above the second: 1 mm is the largest error a machine passes the gate
  /// with, and its rms is lower; the path of another run misses by centimetres, and so do the last
  /// blocks of a truncated one.
  double max_alignment_rms_m = 1e-3;
  double max_alignment_distance_m = 3e-3;
  /// Alignment is refused if measured and nominal length of the path differ by more than this
  /// fraction.
  double max_length_mismatch = 0.05;
  /// Gauge weight relative to trace(H)/trace(K^T K). Any positive value gives the same solution
  /// (minimal constraints).
  double gauge_weight = 1.0;
  /// Weighted observations for the held-out comparison are split by leg into this many parts.
  std::size_t held_out_folds = 5;
  OrientationEvidence orientation;
  Progress progress;  ///< may be empty
  Stopped stopped;    ///< may be empty: never
};

}  // namespace abbe::calib::otf
