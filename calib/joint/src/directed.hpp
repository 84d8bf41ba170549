#pragma once
/// Directed tests of all parts (joint/identify.hpp).

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/internal/model/datum_coordinates.hpp"
#include "abbe/calib/joint/identify.hpp"

namespace abbe::calib::joint {

/// Share of the false alarms of all tests that the chi-square tests of the pairs take.
inline constexpr double kShareOfPairs = 0.1;

/// One combination of the coordinates, whose value is one quantity of the machine.
struct Direction {
  std::string name;  ///< "length", "scale of X", "EC0Y"
  bool is_angle = false;
  Eigen::VectorXd column;
  double share = 0.0;  ///< of the false alarms of all tests
};
/// Length, scales of X, Y, Z, squareness.
[[nodiscard]] std::vector<Direction> directions(const DatumCoordinates&, const ParameterLayout&);

/// A directed test with what the order of the causes needs.
struct DirectedFinding {
  DirectedTest test;
  double log_p = 0.0;  ///< of the improvement, as Explanation::log_p
};
[[nodiscard]] std::vector<DirectedFinding> directed_findings(std::span<const Part>,
                                                             const DatumCoordinates&,
                                                             const ParameterLayout&,
                                                             double false_alarm);

}  // namespace abbe::calib::joint
