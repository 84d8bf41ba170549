#pragma once
/// A model sampled on a tensor grid, for receivers that interpolate linearly between the nodes. The
/// interpolation error is part of the uncertainty of the received values.

#include <array>
#include <cstddef>
#include <vector>

#include "abbe/calib/volumetric_model.hpp"

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

/// Second moment of the linear interpolation error in the cells around node (i, j, k), averaged
/// over a cell. The caller adds this matrix to cov_V_m2 at this node. Along each axis the
/// interpolation error is modelled as a parabola c p(x) between nodes, p = 1 halfway. c is the
/// error halfway to a neighbour node; of the two neighbours, the one with the larger error counts.
/// The averages over a cell are
///     E[p^2] = 8/15,   E[p p'] = 4/9   (p' along another axis).
/// Zero if every_node. Pure.
[[nodiscard]] Matrix3 interpolation_moment(const VolumetricModel&, const InterpolationGrid&,
                                           const std::array<std::size_t, 3>& node);

}  // namespace abbe::calib
