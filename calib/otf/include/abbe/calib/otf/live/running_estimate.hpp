#pragma once
/// The tables of a run that is not complete, with their uncertainties: pose of the tracker, moments
/// of the samples (moments.hpp) and a solution in datum G2 of what they determine so far.
///
/// The pose fits pairs (axis position, sample) taken at the vertices. Its error is estimated by the
/// six rigid unknowns, which are linear. With the rotation phi and the displacement D (largest,
/// over the pairs) between the pose of the accumulation and a better one, and the extent L of the
/// pairs, the terms of second order are
///     phi^2 L / 2 + phi D
/// The pose is kept while they are below 0.1 um; else the caller adds all samples again. Terms of
/// second order with phi = 3e-4 and L = 0.6 m are 0.08 um.
///
/// An unknown is determined if no combination of the unknowns that meets the conditions of the
/// datum and that no observation sees contains it, and if its standard uncertainty is less than
/// 0.05 mm or 0.05 mrad. A prior of 1 mm and 1 mrad makes the system regular; it changes a
/// determined unknown by less than (0.05)^2 of its value.
///
/// Uncertainty: noise of the samples times a variance factor, range offset (estimated with its
/// prior), scale of the ranges and of the axes. The factor is the larger of chi2/dof of all rows
/// and chi2/dof of the cells against each other, which noise that is correlated over the time of a
/// cell (turbulence) increases; it is never less than 1.
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
  double value = 0.0, u = 0.0;  ///< m or rad, datum G2; 0 if it is not determined
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
  std::array<NodeSoFar, 3> squareness{};  ///< EA0Z EB0Z EC0Y
  std::optional<Vector6> rigid;           ///< T, r if they are determined
  std::size_t samples = 0;                ///< used
  double variance_factor = 1.0;
};

/// Not thread-safe. Memory: that of MomentAccumulator and one pair for each vertex.
class RunningEstimate {
 public:
  struct Setup {
    Machine machine;
    Noise noise;
    double corner_m = 0.010;  ///< Options::corner_m
    TravelDependence backlash = TravelDependence::None;
  };
  /// Errors: those of the layout of the machine and of MomentAccumulator.
  [[nodiscard]] static Result<RunningEstimate> of(Setup);

  /// The machine near a stop at `q_m`, where the tracker saw `p_tracker_m`.
  void add_pair(const Vector3& q_m, const Vector3& p_tracker_m);
  /// Fits the pose to the pairs. True: the pose is new, the accumulation is empty, and all samples
  /// must be added again.
  [[nodiscard]] bool update_pose();
  /// Corrects the pose by the rigid unknowns of a solution. From then on it is not fitted to pairs.
  /// True: as update_pose().
  [[nodiscard]] bool correct_pose(const TablesSoFar&);
  /// Three pairs span a plane: samples can be added.
  [[nodiscard]] bool has_pose() const { return moments_.has_value(); }

  /// As in MomentAccumulator; ignored before has_pose().
  void begin_leg(const Vector3& from_m, const Vector3& to_m);
  void add(const Vector3& p_tracker_m);

  /// Relative standard uncertainties that are known during the run only; see Noise.
  void set_scale(double u_scale, const std::array<double, 3>& u_axis_scale);
  /// TooFewObservations before has_pose().
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
  AxisTravel travel_{};  ///< on the present leg
  std::optional<MomentAccumulator> moments_;
};

}  // namespace abbe::calib::otf
