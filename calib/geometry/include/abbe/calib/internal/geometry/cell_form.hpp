#pragma once
/// A table basis in terms of the ends of a cell. A cubic depends on all nodes of its table, because
/// the second derivatives U'' = M U (axis_interpolation.hpp) do. With the parameters
///     Z = T U: for each table U_0 .. U_m, then U''_0 .. U''_m; behind the tables the squareness
/// V has at most four columns per table, as few as cheap propagation of a covariance needs:
///     V = B_Z Z,   Cov(Z) = T Cov(U) T^T

#include <Eigen/Core>
#include <cstddef>

#include "abbe/calib/geometry/table_basis.hpp"

namespace abbe::calib {

/// Largest number of columns of append_cell_columns(): 18 tables, and squareness.
inline constexpr std::size_t kMostCellColumns = 18 * 4 + 3;

/// T X for X with one row per parameter of ParameterLayout (U, or a covariance).
[[nodiscard]] Eigen::MatrixXd with_curvatures(const TableBasis&, const Eigen::MatrixXd& X);
/// T C T^T.
[[nodiscard]] Eigen::MatrixXd covariance_with_curvatures(const TableBasis&,
                                                         const Eigen::MatrixXd& C);

/// Appends the columns of B_Z, without those of a dependence on the direction of travel. No
/// allocation; needs space for kMostCellColumns.
void append_cell_columns(const TableBasis&, const MachineState&, ModelColumns&);

}  // namespace abbe::calib
