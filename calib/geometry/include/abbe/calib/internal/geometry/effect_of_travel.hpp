#pragma once

#include "abbe/calib/geometry/travel_differences.hpp"

namespace abbe::calib {

/// What is added to V and its covariance of the mean of both directions.
struct TravelEffect {
  Vector3 V_m = Vector3::Zero();
  Matrix3 cov_m2 = Matrix3::Zero();
};

/// For the direction of travel in the state. The covariance of the mean contains h h^T of each
/// axis, h: effect of half its differences.
/// - Direction known: V changes by s h, and the covariance of U and D replaces h h^T.
/// - Unknown: V is the mean of two values. Its variance is E(h h^T) = h h^T + Cov(h).
[[nodiscard]] TravelEffect effect_of_travel(const TableBasis& basis, const TravelDifferences&,
                                            const MachineState&);

}  // namespace abbe::calib
