#pragma once
/// Directed tests of all parts (joint/identify.hpp).

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/internal/model/datum_coordinates.hpp"
#include "abbe/calib/joint/identify.hpp"

namespace abbe::calib::joint {

/// Share of the false-alarm probability of all tests that belongs to the chi-square tests of the
/// pairs.
inline constexpr double kShareOfPairs = 0.1;

/// A combination of the coordinates e (`column`) that represents one quantity of the machine.
struct Direction {
  std::string name;  ///< "length", or such as "scale of X", "EC0Y"
  bool is_angle = false;
  Eigen::VectorXd column;
  double share = 0.0;  ///< share of the false-alarm probability of all tests
};
/// Returns the directions: length, scales of X, Y, Z, squareness errors.
[[nodiscard]] std::vector<Direction> directions(const DatumCoordinates&, const ParameterLayout&);

/// A directed test, with log_p to sort the explanations.
struct DirectedFinding {
  DirectedTest test;
  double log_p = 0.0;  ///< as Explanation::log_p
};
[[nodiscard]] std::vector<DirectedFinding> directed_findings(std::span<const Part>,
                                                             const DatumCoordinates&,
                                                             const ParameterLayout&,
                                                             double false_alarm);

}  // namespace abbe::calib::joint
