#pragma once
/// A model on a tensor grid, for those who only interpolate linearly between its nodes. What they
/// miss by that is part of their uncertainty.

#include <array>
#include <cstddef>
#include <vector>

#include "abbe/calib/volumetric_model.hpp"

namespace abbe::calib {

/// Coordinates by axis, ascending, at least two.
using GridAxes = std::array<std::vector<double>, 3>;

struct InterpolationGrid {
  GridAxes axes_m;
  bool every_node = false;  ///< of tables: none was left out, linear interpolation is exact
};

/// At most `most_nodes` (>= 8) of them. Of tables the nodes themselves, as long as they fit; else
/// the longest axis gives some up, again and again. Of polynomials equidistant over the box of the
/// hull, more along the axes V bends along.
[[nodiscard]] InterpolationGrid interpolation_grid(const VolumetricModel&, std::size_t most_nodes);

/// Second moment of what linear interpolation misses in the cells around node (i, j, k), mean over
/// a cell: to be added to cov_V_m2 there. Along an axis the miss is a parabola between nodes, c the
/// larger of the misses halfway to either neighbour; over the cell E[p^2] = 8/15, E[p p'] = 4/9.
/// Zero if every_node. Pure.
[[nodiscard]] Matrix3 interpolation_moment(const VolumetricModel&, const InterpolationGrid&,
                                           const std::array<std::size_t, 3>& node);

}  // namespace abbe::calib
