#pragma once
/// A received field of errors against known errors. Lengths in m. Pure.

#include <Eigen/Core>
#include <cstddef>
#include <span>

#include "abbe/base/error.hpp"
#include "abbe/messages/error_lattice.hpp"

namespace abbe::dds {

struct FieldComparison {
  struct Lengths {
    double mean_m = 0.0, max_m = 0.0;
  };
  std::size_t points = 0;   ///< number of compared points
  std::size_t outside = 0;  ///< points without a value in the field
  Lengths before;           ///< |V_known|
  Lengths after;            ///< |V_known - V_field|, datums unchanged
  /// |V_known - V_field| after removal of the best-fit rigid motion T + r x p
  Lengths after_rigid_free;
};
/// Compares `known_V_m` at `positions_m` with the field. DataInsufficient for fewer than 3 points
/// inside the field, or all of them on a line.
[[nodiscard]] daemon::Result<FieldComparison> compare(std::span<const Eigen::Vector3d> positions_m,
                                                      std::span<const Eigen::Vector3d> known_V_m,
                                                      const daemon::ErrorLattice& field);

}  // namespace abbe::dds
