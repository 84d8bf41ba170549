#pragma once
/// Backlash of the error tables: a list of the differences between both directions of travel
/// (TravelDifferences), each with name and uncertainty. Pure.

#include <Eigen/Core>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/calib/model/volumetric_model.hpp"

namespace abbe::calib {

/// Standard uncertainty of the prior of a difference between both directions, m or rad. If the data
/// alone give an uncertainty of 1 um, this prior reduces the estimate by only 1e-4 of its value.
inline constexpr double kUOfBacklash = 100e-6;

/// Name in files and options: "none", "per-table" (Backlash), "forward-backward" (Tables).
[[nodiscard]] std::string_view backlash_name(TravelDependence);
[[nodiscard]] std::optional<TravelDependence> backlash_named(std::string_view);

/// Difference between both directions of travel: forward minus backward.
struct Backlash {
  ErrorMotion motion;
  std::optional<double> position_m{};  ///< position of the node; nullopt for one value per table
  double value = 0.0;                  ///< difference in m or rad
  double u = 0.0;                      ///< standard uncertainty; includes the variance factor
  bool determined = false;             ///< false: only the prior determines the value
};
/// Text such as "EXX" or "EXX at -0.300 m".
[[nodiscard]] std::string label(const Backlash&);

/// Lists the differences D of `basis`; `covariance` is that of D.
[[nodiscard]] std::vector<Backlash> listed_differences(const TableBasis& basis,
                                                       const Eigen::VectorXd& D,
                                                       const Eigen::MatrixXd& covariance);
/// Lists the differences of a model, in their order. Empty if the model has none.
[[nodiscard]] std::vector<Backlash> backlash_of(const VolumetricModel&);

/// The determined difference with the largest absolute value for each table, in the order of the
/// tables.
[[nodiscard]] std::vector<Backlash> largest_of_tables(std::span<const Backlash>);
/// Notes for the verdict: the tables whose largest difference exceeds four standard uncertainties,
/// each with this difference; and the differences that are not determined.
[[nodiscard]] std::vector<std::string> notes_on(std::span<const Backlash>);

}  // namespace abbe::calib
