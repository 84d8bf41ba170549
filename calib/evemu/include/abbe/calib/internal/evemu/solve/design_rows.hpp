#pragma once
/// Effect of a volumetric error on the observed errors of a ball array (observe.hpp), as rows of a
/// linear problem in the unknowns of a design (volumetric_design.hpp).

#include <Eigen/Core>

#include "abbe/calib/evemu/observe/observe.hpp"
#include "abbe/calib/internal/evemu/solve/volumetric_design.hpp"

namespace abbe::calib::evemu {

/// Column j: the rotation Theta_p [rad] by which a volumetric error equal to function j of the
/// design rotates the measured artefact (observe.hpp), to first order. 3 x design.unknowns.
[[nodiscard]] Eigen::Matrix3Xd block_rotation(const TouchedArtefact&, const VolumetricDesign&);
/// Column j: the displacement D by which a volumetric error equal to function j of the design
/// displaces the fitted centre of a ball (index from 0; observe.hpp), to first order. 3 x
/// design.unknowns.
[[nodiscard]] Eigen::Matrix3Xd ball_displacement(const TouchedArtefact&, std::size_t ball,
                                                 const VolumetricDesign&);

/// Source of the design rows. Centres: values of the design functions at the ball centre, as in [Li
/// OMM]. Touches: displacement D and rotation Theta from the touched points; requires
/// Observations::seen. With Touches the three rotations of V about Ball1 are not observable.
enum class RowsFrom { Centres, Touches };

/// Design rows of the observations, 3 rows.size() x design.unknowns. With the observed error zero,
/// the rows of Ball1 state that V (RowsFrom::Centres) or D (RowsFrom::Touches) is 0 at Ball1.
[[nodiscard]] Eigen::MatrixXd design_rows(const Observations&, const VolumetricDesign&, RowsFrom);
/// design_rows() relative to Ball1 of the position, as the observed errors are. The rows of Ball1
/// state that V = 0 at the mean reading of Ball1. If they stated V = 0 at every single reading, the
/// scatter of these readings would be taken for information about slopes of V.
[[nodiscard]] Eigen::MatrixXd relative_rows(const Observations&, const VolumetricDesign&, RowsFrom);
/// The observed V of all rows as one vector, 3 rows.size().
[[nodiscard]] Eigen::VectorXd observed_m(const Observations&);

}  // namespace abbe::calib::evemu
