#pragma once
/// A model sampled on a tensor grid, for receivers that interpolate linearly between the nodes. The
/// interpolation error is part of the uncertainty of the received values.

#include <array>
#include <cstddef>
#include <vector>

#include "abbe/calib/model/volumetric_model.hpp"

namespace abbe::calib {

/// Node coordinates of each axis in m, ascending, at least two per axis.
using GridAxes = std::array<std::vector<double>, 3>;

struct InterpolationGrid {
  GridAxes axes_m;
  bool every_node = false;  ///< all nodes of linear tables are used: linear interpolation is exact
};

/// A grid of at most `most_nodes` (>= 8) nodes.
/// - Linear tables: the nodes of the tables. While there are too many, one node is removed from the
///   axis with the most nodes.
/// - Polynomials and cubic tables: equidistant nodes, more of them on axes along which V has a
///   larger second derivative; over the bounding box of the validity hull, for tables over their
///   whole range.
[[nodiscard]] InterpolationGrid interpolation_grid(const VolumetricModel&, std::size_t most_nodes);

/// Error of linear interpolation of V, V minus interpolated V, in the cells around a node.
struct InterpolationError {
  Vector3 mean_m = Vector3::Zero();     ///< mean of the error over these cells
  Matrix3 moment_m2 = Matrix3::Zero();  ///< second moment of the error about the mean, averaged
                                        ///< over a cell
};

/// Computes the error at node (i, j, k). The caller adds mean_m to V and moment_m2 to cov_V_m2
/// there: V + mean_m is the node value with the smallest mean square error between the nodes. Along
/// each axis the error is modelled as a parabola c p(x) between nodes, p = 1 halfway; c is the
/// error halfway to a neighbour node. The averages over a cell are
///     E[p] = 2/3,   E[(p - E[p])^2] = 4/45,   E[(p - E[p]) (p' - E[p'])] = 0   (p': another axis).
/// mean_m contains the mean c of both neighbours. moment_m2 contains the larger c, and the
/// difference of both. For linear tables with omitted nodes mean_m is zero, because V at the nodes
/// is the model itself. moment_m2 is then the moment about zero, with
///     E[p^2] = 8/15,   E[p p'] = 4/9.
/// All zero if every_node. Pure.
[[nodiscard]] InterpolationError interpolation_error(const VolumetricModel&,
                                                     const InterpolationGrid&,
                                                     const std::array<std::size_t, 3>& node);

}  // namespace abbe::calib
