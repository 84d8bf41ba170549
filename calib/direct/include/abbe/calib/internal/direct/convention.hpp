#pragma once
/// Conventions of error tables as linear operators on values at ascending positions.

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/direct/compare.hpp"

namespace abbe::calib::direct {

/// Least number of positions of a comparison. With fewer, the conditions of a convention leave no
/// value that can be compared.
inline constexpr std::size_t kLeastPositions = 3;

/// The value as text with three significant digits, for messages.
[[nodiscard]] std::string three_digits(double value);

/// Number of conditions that the convention imposes on a table: 2 for straightness, else 1.
[[nodiscard]] std::size_t conditions_of(ErrorMotion);

/// Position at which positioning and rotations are set to zero (compare.hpp).
[[nodiscard]] double zero_position_m(std::span<const double> positions_m, double reference_m);

/// The operator P of compare.hpp. Needs at least 2 positions.
[[nodiscard]] Eigen::MatrixXd reduction(ErrorMotion, std::span<const double> positions_m,
                                        double reference_m, StraightnessLine);
[[nodiscard]] std::string convention_text(ErrorMotion, std::span<const double> positions_m,
                                          double reference_m, StraightnessLine);

/// Matrix W: W * (values at the positions) is the linear interpolation at the nodes.
[[nodiscard]] Eigen::MatrixXd interpolation_matrix(std::span<const double> positions_m,
                                                   std::span<const double> nodes_m);

/// Row s: s * values is the slope of the line that reduction() removes from a straightness.
[[nodiscard]] Eigen::RowVectorXd slope_row(std::span<const double> positions_m, StraightnessLine);

}  // namespace abbe::calib::direct
