#pragma once
/// What a volumetric error does to what is seen of a ball array (observe.hpp), as rows of a linear
/// problem in the coefficients of the scaled design.

#include <Eigen/Core>

#include "abbe/calib/evemu/observe.hpp"

namespace abbe::calib::evemu {

/// Theta_p of every function of the design, 3 x design.size(), to first order.
[[nodiscard]] Eigen::Matrix3Xd block_rotation(const SeenArtefact&, const ScaledDesign&);
/// D of every function at a ball (index from 0), 3 x design.size(), to first order.
[[nodiscard]] Eigen::Matrix3Xd ball_displacement(const SeenArtefact&, std::size_t ball,
                                                 const ScaledDesign&);

/// What a row of the design is made of. Centres: B at the centre, as in [Li OMM]. Touches: D and
/// Theta above; needs `seen`, and leaves the three rotations about Ball1 without any observation.
enum class RowsFrom { Centres, Touches };

/// Design rows of the observations, 3 rows.size() x design.size(). Those of Ball1 ask for V (or
/// D) = 0 there.
[[nodiscard]] Eigen::MatrixXd design_rows(const Observations&, const ScaledDesign&, RowsFrom);
/// The same relative to the position's Ball1, as the errors are. Ball1's own rows ask for V = 0 at
/// its mean reading: asked at every reading, their scatter would pass for knowledge about slopes of
/// V.
[[nodiscard]] Eigen::MatrixXd relative_rows(const Observations&, const ScaledDesign&, RowsFrom);
/// Observed V, 3 rows.size().
[[nodiscard]] Eigen::VectorXd observed_m(const Observations&);

}  // namespace abbe::calib::evemu
