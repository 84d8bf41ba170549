#pragma once
/// Bends of the error tables (smoothness.hpp) as coordinates.

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <vector>

#include "abbe/calib/estimation/row_batch.hpp"
#include "abbe/calib/geometry/error_parameters.hpp"
#include "abbe/calib/geometry/parameter_layout.hpp"

namespace abbe::calib::otf {

struct TableBend {
  ErrorMotion motion;
  double position_m = 0.0;                    ///< of the middle node
  double from_m = 0.0, to_m = 0.0;            ///< positions of the nodes beside it
  std::array<estimation::RowEntry, 3> row{};  ///< bend = row . U
  double sigma_of_unit = 1.0;                 ///< standard deviation of the prior for bend 1 m
};
/// Of all inner nodes of all tables, in the order of the unknowns.
[[nodiscard]] std::vector<TableBend> bends_of(const ParameterLayout&);

/// U = U_of (x): the bends in the place of their middle nodes + 1, all other unknowns in their own.
struct BendCoordinates {
  Eigen::MatrixXd U_of;             ///< unknowns x unknowns
  std::vector<std::size_t> others;  ///< coordinates that are no bends, ascending
};
[[nodiscard]] BendCoordinates bend_coordinates(const std::vector<TableBend>&,
                                               Eigen::Index unknowns);

}  // namespace abbe::calib::otf
