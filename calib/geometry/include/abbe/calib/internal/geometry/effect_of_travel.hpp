#pragma once

#include "abbe/calib/geometry/travel_differences.hpp"

namespace abbe::calib {

/// Terms added to the V and covariance of a model that is the mean of both directions of travel.
struct TravelEffect {
  Vector3 V_m = Vector3::Zero();
  Matrix3 cov_m2 = Matrix3::Zero();
};

/// Computes the terms for the direction of travel in the state. The covariance of the mean contains
/// h h^T for each axis, h: effect on V of half the differences D of this axis.
/// - Direction known: V changes by s h (s = 1 forward, -1 backward). The covariance that follows
///   from U and D replaces h h^T.
/// - Direction unknown: V stays the mean of two values. Its variance is E(h h^T) = h h^T + Cov(h).
[[nodiscard]] TravelEffect effect_of_travel(const TableBasis& basis, const TravelDifferences&,
                                            const MachineState&);

}  // namespace abbe::calib
