#pragma once
/// Expresses a table basis by values at the ends of a cell. A cubic depends on all nodes of its
/// table through the second derivatives U'' = M U (axis_interpolation.hpp). With the parameters
///     Z = T U: for each table U_0 .. U_m, then U''_0 .. U''_m; after all tables the squareness
/// V has at most four columns per table, so that its covariance is propagated in little time:
///     V = B_Z Z,   Cov(Z) = T Cov(U) T^T

#include <Eigen/Core>
#include <cstddef>

#include "abbe/calib/geometry/table_basis.hpp"

namespace abbe::calib {

/// Largest number of columns of append_cell_columns(): 18 tables, and squareness.
inline constexpr std::size_t kMostCellColumns = 18 * 4 + 3;

/// T X (T: see above). X has one row per parameter of ParameterLayout, for example U or a
/// covariance.
[[nodiscard]] Eigen::MatrixXd with_curvatures(const TableBasis&, const Eigen::MatrixXd& X);
/// T C T^T (T: see above) for a covariance C of U.
[[nodiscard]] Eigen::MatrixXd covariance_with_curvatures(const TableBasis&,
                                                         const Eigen::MatrixXd& C);

/// Appends the columns of B_Z for the mean of both directions of travel. Does not allocate;
/// `columns` needs space for kMostCellColumns.
void append_cell_columns(const TableBasis&, const MachineState&, ModelColumns&);

}  // namespace abbe::calib
