#pragma once
/// Parts that observe() and planned_observations() have in common.

#include <map>
#include <memory>
#include <vector>

#include "abbe/calib/mfb/observe/observe.hpp"

namespace abbe::calib::mfb {

/// The nominal bar at the centres of the tip, and its derivatives for sets of touches.
class NominalBar {
 public:
  NominalBar(const Bar&, double tip_radius_m);
  [[nodiscard]] const std::vector<NominalTouch>& touches() const { return touches_; }
  /// PassObservation::dO_dtouch for the touches at these places. Errors of points_of_interest().
  [[nodiscard]] Result<Eigen::MatrixXd> dO_dtouch(const std::vector<std::size_t>& places);

 private:
  TouchPattern pattern_;
  std::vector<NominalTouch> touches_;
  std::map<std::vector<std::size_t>, Eigen::MatrixXd> known_;
};

/// Positions, tools and pairs of a plan; poses as planned, no touches.
[[nodiscard]] Result<Observations> observations_of_plan(const Bar&, const Plan&, const MfbMachine&);

/// Sets everything of a pass that follows from its touches and the pose of its position, but not
/// the deviations. `time`: 0..1 of each touch. BadInput for a reading outside the nodes.
[[nodiscard]] Result<void> place_touches(Observations&, PassObservation&, NominalBar&,
                                         std::vector<std::size_t> places,
                                         const std::vector<double>& time);

/// Deviations of one pass from its touches. `sets_pose`: the pose of the position becomes that of
/// this pass. Errors of observe().
[[nodiscard]] Result<void> observe_pass(Observations&, PassObservation&, const PassTouches&,
                                        NominalBar&, const ObserveLimits&, bool sets_pose);

/// Displacement of the O_i by the sag of the bar, 3N, bar axes.
[[nodiscard]] Eigen::VectorXd sag_of_points(const Observations&, const PassObservation&,
                                            const std::vector<NominalTouch>&);

}  // namespace abbe::calib::mfb
