#pragma once
/// One bend of an error table (smoothness.hpp) as a linear function of U.

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
  double position_m = 0.0;                    ///< position of the middle node
  double from_m = 0.0, to_m = 0.0;            ///< positions of the nodes beside it
  std::array<estimation::RowEntry, 3> row{};  ///< weights: bend = row . U
  double sigma_of_unit = 1.0;                 ///< standard deviation of the prior for
                                              ///< SmoothnessOptions::bend_m = 1 m
};
/// Returns the bends at all inner nodes of all tables, in the order of the unknowns.
[[nodiscard]] std::vector<TableBend> bends_of(const ParameterLayout&);

/// Coordinates x with U = U_of x: at the index of a bend's middle node + 1, x contains the bend; at
/// all other indices, x contains the unknown itself.
struct BendCoordinates {
  Eigen::MatrixXd U_of;             ///< matrix of size unknowns x unknowns
  std::vector<std::size_t> others;  ///< coordinates that are not bends, ascending
};
[[nodiscard]] BendCoordinates bend_coordinates(const std::vector<TableBend>&,
                                               Eigen::Index unknowns);

}  // namespace abbe::calib::otf
