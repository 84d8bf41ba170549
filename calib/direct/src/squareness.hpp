#pragma once
/// Squareness in the convention of the straightness errors: between the lines that a convention
/// removes from them.

#include <Eigen/Core>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/direct/compare.hpp"

namespace abbe::calib::direct {

/// A measured straightness whose line over all its positions is not that over the common ones.
struct LineChange {
  ErrorMotion straightness;
  std::vector<double> positions_m;  ///< the common ones
  double measured_slope = 0.0;      ///< over the common positions, relative to the line over all
  std::optional<Vector3> line_m{};  ///< see MeasuredError
  bool shortened = false;           ///< measured beyond the common positions
};
/// nullopt for errors that are no straightness.
[[nodiscard]] std::optional<LineChange> line_change(ErrorMotion, const Runs& all,
                                                    const std::optional<Vector3>& line_m,
                                                    std::span<const double> common_m,
                                                    StraightnessLine);

/// Row r such that r * U is the squareness between two lines that meet at the axis position at_m,
/// from the slopes of V along them ("/": over the common positions of the straightness, or over the
/// nodes of the axis if it was not measured):
///     C0Y = -V_x / y - V_y / x,   B0Z = V_x / z + V_z / x,   A0Z = -V_y / z - V_z / y
[[nodiscard]] Eigen::RowVectorXd squareness_row(const std::string& name, const TableBasis&,
                                                const Vector3& tool_m, const Vector3& at_m,
                                                std::span<const LineChange>, StraightnessLine);
/// Empty if it can be compared. `nodes`: the common range.
[[nodiscard]] std::string why_not_comparable(const MeasuredError& squareness,
                                             const MachineNodes& nodes,
                                             std::span<const LineChange>);
/// To be added to the measured squareness, so that it refers to the lines over the common positions
/// instead of those over all measured ones.
[[nodiscard]] double squareness_change(const std::string& name, std::span<const LineChange>);
[[nodiscard]] std::string squareness_text(const std::string& name, std::span<const LineChange>);

}  // namespace abbe::calib::direct
