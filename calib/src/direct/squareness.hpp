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
};
/// nullopt for errors that are no straightness.
[[nodiscard]] std::optional<LineChange> line_change(ErrorMotion, const Runs& all,
                                                    std::span<const double> common_m,
                                                    StraightnessLine);

/// Row r such that r * U is the squareness of the model between the lines over the common positions.
[[nodiscard]] Eigen::RowVectorXd squareness_row(const std::string& name, const VolumetricModel&,
                                                std::span<const LineChange>, StraightnessLine);
/// To be added to the measured squareness, so that it refers to the lines over the common positions
/// instead of those over all measured ones.
[[nodiscard]] double squareness_change(const std::string& name, std::span<const LineChange>);
[[nodiscard]] std::string squareness_text(const std::string& name, std::span<const LineChange>);

}  // namespace abbe::calib::direct
