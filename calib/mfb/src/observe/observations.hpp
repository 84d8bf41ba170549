#pragma once
/// Functions that observe() and planned_observations() both use.

#include <map>
#include <memory>
#include <vector>

#include "abbe/calib/mfb/observe/observe.hpp"

namespace abbe::calib::mfb {

/// The nominal bar with the touched centres of the tip, and its derivatives for sets of touches.
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

/// Observations with the positions, tools and pairs of a plan; poses as planned, without touches.
[[nodiscard]] Result<Observations> observations_of_plan(const Bar&, const Plan&, const MfbMachine&);

/// Sets all members of a pass that follow from its touches and the pose of its position; the
/// deviations are not set. `time`: 0 to 1 for each touch. BadInput for a reading outside the nodes.
[[nodiscard]] Result<void> place_touches(Observations&, PassObservation&, NominalBar&,
                                         std::vector<std::size_t> places,
                                         const std::vector<double>& time);

/// Computes the deviations of one pass from its touches. `sets_pose`: the pose of the position
/// becomes that of this pass. Errors of observe().
[[nodiscard]] Result<void> observe_pass(Observations&, PassObservation&, const PassTouches&,
                                        NominalBar&, const ObserveLimits&, bool sets_pose);

/// Displacement of the O_i by the sag of the bar, 3N, bar axes.
[[nodiscard]] Eigen::VectorXd sag_of_points(const Observations&, const PassObservation&,
                                            const std::vector<NominalTouch>&);

}  // namespace abbe::calib::mfb
