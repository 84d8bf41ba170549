#pragma once
/// Squareness consistent with the convention of the straightness errors: it is the angle between
/// the lines that the convention removes from them.

#include <Eigen/Core>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/direct/compare.hpp"

namespace abbe::calib::direct {

/// A measured straightness, and how its reference line changes from the line over all its positions
/// to the line over the common positions.
struct LineChange {
  ErrorMotion straightness;
  std::vector<double> positions_m;  ///< the common positions
  double measured_slope = 0.0;      ///< slope over the common positions, relative to the line over
                                    ///< all positions
  std::optional<Vector3> line_m{};  ///< see MeasuredError
  bool shortened = false;           ///< true if it was measured beyond the common positions
};
/// Returns nullopt for errors that are not a straightness.
[[nodiscard]] std::optional<LineChange> line_change(ErrorMotion, const Runs& all,
                                                    const std::optional<Vector3>& line_m,
                                                    std::span<const double> common_m,
                                                    StraightnessLine);

/// Row r: r * U is the squareness between two lines that meet at the axis position at_m. It uses
/// the slopes of V along both lines ("/"), over the common positions of the straightness, or over
/// the nodes of the axis if the straightness was not measured:
///     C0Y = -V_x / y - V_y / x,   B0Z = V_x / z + V_z / x,   A0Z = -V_y / z - V_z / y
[[nodiscard]] Eigen::RowVectorXd squareness_row(const std::string& name, const TableBasis&,
                                                const Vector3& tool_m, const Vector3& at_m,
                                                std::span<const LineChange>, StraightnessLine);
/// The reason why the squareness cannot be compared, or an empty text. `nodes`: the common range.
[[nodiscard]] std::string why_not_comparable(const MeasuredError& squareness,
                                             const MachineNodes& nodes,
                                             std::span<const LineChange>);
/// Angle in rad to be added to the measured squareness. The sum refers to the lines over the common
/// positions instead of the lines over all measured positions.
[[nodiscard]] double squareness_change(const std::string& name, std::span<const LineChange>);
[[nodiscard]] std::string squareness_text(const std::string& name, std::span<const LineChange>);

}  // namespace abbe::calib::direct
