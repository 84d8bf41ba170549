#pragma once
/// Coordinates e of a model in datum G2 that are free of the datum's conditions K U = 0:
///     U = N e,   K N = 0,   N^T N = I
/// Every column of N belongs to one table, or to one squareness error. The covariance of U is
/// singular because of the conditions; that of e is regular.

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "abbe/calib/geometry/table_basis.hpp"

namespace abbe::calib {

/// A table or a squareness error.
struct DatumGroup {
  std::string name;                     ///< such as "EXX", "EC0Y"
  std::optional<ErrorMotion> motion{};  ///< nullopt: squareness
  Eigen::Index offset = 0, count = 0;   ///< range of its parameters in U
  Eigen::Index first = 0, size = 0;     ///< range of its coordinates in e; size 0: the datum fixes
                                        ///< all its parameters

  [[nodiscard]] bool is_angle() const { return !motion || is_rotation(motion->motion); }
};

struct DatumCoordinates {
  Eigen::MatrixXd N;               ///< rows: parameters of the model, columns: coordinates e
  std::vector<DatumGroup> groups;  ///< in the order of the parameters

  /// Converts the rows of `matrix` (one row per parameter) that belong to the group to rows of the
  /// group's coordinates.
  [[nodiscard]] Eigen::MatrixXd of_group(const DatumGroup&, const Eigen::MatrixXd& matrix) const;
};
[[nodiscard]] DatumCoordinates datum_coordinates(const TableBasis&);

/// True if the covariance of a model (one row per parameter) can be expressed by the coordinates e.
/// False if it also contains half the backlash (backlash.hpp), which is common to all runs and
/// changes no e.
[[nodiscard]] bool is_in_datum(const DatumCoordinates&, const Eigen::MatrixXd& covariance);

/// Smoothest change of a group that the datum permits, one value per parameter; the largest value
/// is 1. Straightness: a parabola that is 0 at both ends; other tables: a line that is 0 at the
/// reference; squareness: 1.
[[nodiscard]] Eigen::VectorXd smooth_change(const DatumGroup&, const ParameterLayout&);

}  // namespace abbe::calib
