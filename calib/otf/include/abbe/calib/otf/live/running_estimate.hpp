#pragma once
/// Estimates the tables of a run that is not complete, with their uncertainties: pose of the
/// tracker, moments of the samples (moments.hpp), and a solution in datum G2 of the unknowns that
/// are determined so far.
///
/// The pose is fitted to pairs (axis position, sample) taken at the vertices. The six rigid
/// unknowns estimate its error; they are linear. For two poses, that of the accumulation and a
/// better one, with the rotation phi and the displacement D between them (largest over the pairs)
/// and the extent L of the pairs, the terms of second order are
///     phi^2 L / 2 + phi D
/// The pose is kept while these terms are below 0.1 um; otherwise the caller must add all samples
/// again. Example: 0.08 um for phi = 3e-4 and L = 0.6 m.
///
/// An unknown is determined under two conditions. It is not part of any combination of unknowns
/// that satisfies the conditions of the datum and that the observations do not determine; and its
/// standard uncertainty is less than 0.05 mm or 0.05 mrad. A prior of 1 mm and 1 mrad makes the
/// system regular; it changes a determined unknown by less than (0.05)^2 of its value.
///
/// Uncertainty: noise of the samples times a variance factor, range offset (estimated with its
/// prior), scale of the ranges and of the axes. The factor is the larger of chi2/dof of all rows
/// and chi2/dof of the differences between cells; noise that is correlated over the time of a cell
/// (turbulence) increases the latter. The factor is at least 1.
///
/// With Setup::backlash the differences between the directions of travel are unknowns, too, with
/// their prior (backlash.hpp); legs on which a direction is not known are not used. The tables are
/// the mean of both directions, and their uncertainty contains half the difference.

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include "abbe/calib/otf/live/moments.hpp"
#include "abbe/calib/otf/run/travel.hpp"

namespace abbe::calib::otf {

struct NodeSoFar {
  double value = 0.0, u = 0.0;  ///< m or rad, datum G2; both 0 if not determined
  bool determined = false;
};

struct TableSoFar {
  ErrorMotion motion;
  std::vector<NodeSoFar> nodes;
  [[nodiscard]] std::size_t determined_nodes() const;
  [[nodiscard]] bool determined() const { return determined_nodes() == nodes.size(); }
};

struct TablesSoFar {
  std::vector<TableSoFar> tables;         ///< in the order of the layout
  std::array<NodeSoFar, 3> squareness{};  ///< EA0Z, EB0Z, EC0Y
  std::optional<Vector6> rigid;           ///< translation T and rotation r; nullopt: not determined
  std::size_t samples = 0;                ///< number of used samples
  double variance_factor = 1.0;
};

/// Estimate of a run that is still being measured. Not thread-safe. Uses the memory of
/// MomentAccumulator and of one pair for each vertex.
class RunningEstimate {
 public:
  struct Setup {
    Machine machine;
    Noise noise;
    double corner_m = 0.010;  ///< as Options::corner_m
    TravelDependence backlash = TravelDependence::None;
  };
  /// Creates an estimate. Errors: those of the layout of the machine and of MomentAccumulator.
  [[nodiscard]] static Result<RunningEstimate> of(Setup);

  /// Adds a pair: the machine is near a stop at `q_m`, and the tracker measured `p_tracker_m`.
  void add_pair(const Vector3& q_m, const Vector3& p_tracker_m);
  /// Fits the pose to the pairs. Returns true if the pose has changed: the accumulation is then
  /// empty, and all samples must be added again.
  [[nodiscard]] bool update_pose();
  /// Corrects the pose by the rigid unknowns of a solution. From then on the pose is not fitted to
  /// pairs. Returns true as update_pose().
  [[nodiscard]] bool correct_pose(const TablesSoFar&);
  /// True if at least three pairs span a plane, so that samples can be added.
  [[nodiscard]] bool has_pose() const { return moments_.has_value(); }

  /// As in MomentAccumulator; ignored before has_pose().
  void begin_leg(const Vector3& from_m, const Vector3& to_m);
  void add(const Vector3& p_tracker_m);

  /// Sets relative standard uncertainties that become known only during the run; see Noise.
  void set_scale(double u_scale, const std::array<double, 3>& u_axis_scale);
  /// Computes the tables so far. TooFewObservations before has_pose().
  [[nodiscard]] Result<TablesSoFar> tables() const;

 private:
  RunningEstimate(Setup setup, TableBasis basis)
      : setup_(std::move(setup)), basis_(std::move(basis)) {}
  [[nodiscard]] bool take_if_better(const RigidTransform& T_machine_tracker);
  [[nodiscard]] std::optional<double> second_order_m(const RigidTransform& T) const;
  [[nodiscard]] bool use(const RigidTransform& T_machine_tracker);
  [[nodiscard]] bool knows_travel() const;
  [[nodiscard]] double half_difference(std::size_t table, std::size_t node,
                                       const Eigen::VectorXd& U) const;

  Setup setup_;
  TableBasis basis_;
  std::vector<Vector3> at_m_, seen_m_;  ///< pairs: target in the machine, in the tracker frame
  bool corrected_ = false;
  RigidTransform T_machine_tracker_;
  AxisTravel travel_{};  ///< direction of travel on the present leg
  std::optional<MomentAccumulator> moments_;
};

}  // namespace abbe::calib::otf
