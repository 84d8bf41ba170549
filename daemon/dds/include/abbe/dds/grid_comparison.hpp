#pragma once
/// What a received grid is worth against known errors: lengths of V before and after correction. Pure but for
/// the two functions that name a file. SI inside (m); files in mm and um.

#include <array>
#include <cstddef>
#include <filesystem>
#include <span>
#include <vector>

#include "abbe/calib/model_comparison.hpp"
#include "abbe/daemon/error.hpp"
#include "abbe_v1.h"

namespace abbe::dds {

struct KnownError {
  calib::Vector3 position_m;
  calib::Vector3 error_m;  ///< V = true - reading
};

/// `x_mm,y_mm,z_mm,ex_um,ey_um,ez_um`, further columns ignored. Error BadInput with file, line and what is
/// wrong.
[[nodiscard]] daemon::Result<std::vector<KnownError>> read_known_errors(const std::filesystem::path& file);

/// `x_mm,y_mm,z_mm,ex_um,ey_um,ez_um,ux_um,uy_um,uz_um`, u standard uncertainties. Error Io.
[[nodiscard]] daemon::Result<void> write_grid_csv(const std::filesystem::path& file,
                                                  std::span<const v1::GridNode> nodes);

/// V between the nodes of a full tensor grid (any order of nodes), linear in x, y and z; only in cells of
/// which every corner lies within the volume the data covered.
class GridInterpolation {
 public:
  /// Error BadInput if the nodes are not all combinations of the coordinates that occur.
  [[nodiscard]] static daemon::Result<GridInterpolation> create(std::span<const v1::GridNode> nodes);
  /// False: outside of the grid or of what the data covered, `error_m` untouched.
  [[nodiscard]] bool at(const calib::Vector3& position_m, calib::Vector3& error_m) const;

 private:
  std::array<std::vector<double>, 3> nodes_m_;
  std::vector<calib::Vector3> error_m_;  ///< x slowest
  std::vector<bool> inside_;             ///< in the same order
};

struct GridComparison {
  std::size_t points = 0;   ///< compared
  std::size_t outside = 0;  ///< known errors outside of the grid
  calib::VectorStatistics before;
  calib::VectorStatistics after;             ///< |V_true - V_received|, gauge as it is
  calib::VectorStatistics after_rigid_free;  ///< the rigid motion no measurement can see taken out
};
/// Error DataInsufficient: fewer than 3 points inside, or on a line.
[[nodiscard]] daemon::Result<GridComparison> compare(std::span<const KnownError> known,
                                                     const GridInterpolation& grid);

}  // namespace abbe::dds
