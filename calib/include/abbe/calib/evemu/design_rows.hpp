#pragma once
/// Effect of a volumetric error on the observed errors of a ball array (observe.hpp), as rows of a
/// linear problem in the coefficients of the scaled design.

#include <Eigen/Core>

#include "abbe/calib/evemu/observe.hpp"

namespace abbe::calib::evemu {

/// Theta_p (observe.hpp) of every function of the design, 3 x design.size(), to first order.
[[nodiscard]] Eigen::Matrix3Xd block_rotation(const TouchedArtefact&, const ScaledDesign&);
/// D (observe.hpp) of every function at a ball (index from 0), 3 x design.size(), to first order.
[[nodiscard]] Eigen::Matrix3Xd ball_displacement(const TouchedArtefact&, std::size_t ball,
                                                 const ScaledDesign&);

/// Source of the design rows. Centres: B at the ball centre, as in [Li OMM]. Touches: D and Theta
/// from the touched points; requires Observations::seen; the three rotations about Ball1 are then
/// not observable.
enum class RowsFrom { Centres, Touches };

/// Design rows of the observations, 3 rows.size() x design.size(). The rows of Ball1 state that V
/// (or D) is 0 there.
[[nodiscard]] Eigen::MatrixXd design_rows(const Observations&, const ScaledDesign&, RowsFrom);
/// design_rows() relative to Ball1 of the position, as the observed errors are. The rows of Ball1
/// state that V = 0 at the mean reading of Ball1. If they stated V = 0 at every single reading, the
/// scatter of these readings would be taken for information about slopes of V.
[[nodiscard]] Eigen::MatrixXd relative_rows(const Observations&, const ScaledDesign&, RowsFrom);
/// The observed V of all rows as one vector, 3 rows.size().
[[nodiscard]] Eigen::VectorXd observed_m(const Observations&);

}  // namespace abbe::calib::evemu
