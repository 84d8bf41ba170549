#pragma once
/// The files of a calibration with a Multi-Feature Bar, as `abbe identify mfb` and `abbe identify
/// bar` read them: bar.toml, plan.toml, points.csv, machine.toml. Files are in mm, um and urad.
/// Pure.

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/sim/mfb/probing.hpp"

namespace abbe::sim::mfb {

/// The values in bar.toml. The true bar differs from them.
struct StatedBar {
  std::string name = "MFB-1";
  Pattern pattern;
  std::vector<Eigen::Vector3d> O_m, u_m;  ///< points of interest, and their standard uncertainties
  double alpha_per_K = 0.0, u_alpha_per_K = 0.0;  ///< both 0: the file does not contain them
  std::optional<Sag> sag;
};

/// A calibrated bar: the points of the true bar with errors of the standard deviation `u_m`. O_1,
/// and y and z of the last point, are 0 without uncertainty, as the bar frame defines them.
[[nodiscard]] StatedBar calibrated_bar(const TrueBar& bar, const Eigen::Vector3d& u_m,
                                       std::uint64_t seed);
/// A bar before its calibration: nominal points with the tolerance `u_m`.
[[nodiscard]] StatedBar nominal_bar(const Pattern& pattern, const Eigen::Vector3d& u_m);

[[nodiscard]] std::string format_bar_toml(const StatedBar& bar);
[[nodiscard]] std::string format_plan_toml(std::span<const Measurement> plan,
                                           const ProbedBar& probed, const ProbingOptions& options);
[[nodiscard]] std::string format_points_csv(std::span<const Measurement> plan,
                                            const ProbedBar& probed);
/// The machine with cubic tables, whose nodes are `node_spacing_m` apart.
[[nodiscard]] std::string format_machine_toml(const TruthMachine& machine, std::string_view name,
                                              double node_spacing_m);
/// `hole,x_mm,y_mm,z_mm`: points of interest, for a comparison.
[[nodiscard]] std::string format_points_of_interest_csv(std::span<const Eigen::Vector3d> O_m);

}  // namespace abbe::sim::mfb
