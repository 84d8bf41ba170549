#pragma once
/// Coordinates of the models of one layout in datum G2, free of its conditions:
///     U = N e,   K N = 0,   N^T N = I
/// Every column of N belongs to one table, or to one squareness error. The covariance of e is
/// regular where that of U, with its conditions, is singular.

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "abbe/calib/geometry/table_basis.hpp"

namespace abbe::calib {

/// A table or a squareness error.
struct DatumGroup {
  std::string name;                     ///< "EXX", "EC0Y"
  std::optional<ErrorMotion> motion{};  ///< nullopt: squareness
  Eigen::Index offset = 0, count = 0;   ///< its parameters in U
  Eigen::Index first = 0, size = 0;     ///< its coordinates in e; size 0: the datum fixes all of it

  [[nodiscard]] bool is_angle() const { return !motion || is_rotation(motion->motion); }
};

struct DatumCoordinates {
  Eigen::MatrixXd N;               ///< parameters of the model x coordinates
  std::vector<DatumGroup> groups;  ///< in the order of the parameters

  /// The part of `matrix` (one row per parameter) that belongs to the group, in its coordinates.
  [[nodiscard]] Eigen::MatrixXd of_group(const DatumGroup&, const Eigen::MatrixXd& matrix) const;
};
[[nodiscard]] DatumCoordinates datum_coordinates(const TableBasis&);

/// False if the covariance of a model, one row per parameter, contains more than the coordinates e:
/// half the backlash (backlash.hpp), which is common to all runs and changes no e.
[[nodiscard]] bool is_in_datum(const DatumCoordinates&, const Eigen::MatrixXd& covariance);

/// Smoothest change of a group that the datum permits, one value per parameter, 1 where it is
/// largest: straightness a parabola that is 0 at both ends, other tables a line that is 0 at the
/// reference, squareness 1.
[[nodiscard]] Eigen::VectorXd smooth_change(const DatumGroup&, const ParameterLayout&);

}  // namespace abbe::calib
