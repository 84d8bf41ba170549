#pragma once
/// Backlash of the error tables: the differences between both directions of travel
/// (TravelDifferences) one by one, with name and uncertainty. Pure.

#include <Eigen/Core>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/calib/model/volumetric_model.hpp"

namespace abbe::calib {

/// Standard uncertainty of the prior of a difference between both directions, m or rad. Data with
/// an uncertainty of 1 um make a difference smaller by 1e-4 of its value because of the prior.
inline constexpr double kUOfBacklash = 100e-6;

/// In files and options: "none", "per-table", "forward-backward" (TravelDependence::Tables).
[[nodiscard]] std::string_view backlash_name(TravelDependence);
[[nodiscard]] std::optional<TravelDependence> backlash_named(std::string_view);

/// Difference between both directions of travel: forward minus backward.
struct Backlash {
  ErrorMotion motion;
  std::optional<double> position_m{};  ///< of the node; absent for one value per table
  double value = 0.0;                  ///< m or rad
  double u = 0.0;                      ///< standard uncertainty; includes the variance factor
  bool determined = false;             ///< false: only the prior determines the value
};
/// "EXX", "EXX at -0.300 m"
[[nodiscard]] std::string label(const Backlash&);

/// The differences D of `basis`, with their covariance, one by one.
[[nodiscard]] std::vector<Backlash> listed_differences(const TableBasis& basis,
                                                       const Eigen::VectorXd& D,
                                                       const Eigen::MatrixXd& covariance);
/// The differences of a model in their order; empty without.
[[nodiscard]] std::vector<Backlash> backlash_of(const VolumetricModel&);

/// The largest determined difference of each table, in the order of the tables.
[[nodiscard]] std::vector<Backlash> largest_of_tables(std::span<const Backlash>);
/// For the verdict: the tables with backlash beyond four standard uncertainties, each with its
/// largest difference, and the differences that are not determined.
[[nodiscard]] std::vector<std::string> notes_on(std::span<const Backlash>);

}  // namespace abbe::calib
