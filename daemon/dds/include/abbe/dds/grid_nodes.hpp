#pragma once
/// Converts the nodes of a received ErrorGrid to a lattice for interpolation and to a CSV file.

#include <filesystem>
#include <span>

#include "abbe/base/error.hpp"
#include "abbe/messages/error_lattice.hpp"
#include "abbe_v1.h"

namespace abbe::dds {

/// The lattice of the nodes. Error BadInput if daemon::ErrorLattice::create() refuses them.
[[nodiscard]] daemon::Result<daemon::ErrorLattice> lattice_of(std::span<const v1::GridNode> nodes);

/// Writes the columns `x_mm,y_mm,z_mm,ex_um,ey_um,ez_um,ux_um,uy_um,uz_um`; u: standard
/// uncertainty. Error Io: the file cannot be written.
[[nodiscard]] daemon::Result<void> write_grid_csv(const std::filesystem::path& file,
                                                  std::span<const v1::GridNode> nodes);

}  // namespace abbe::dds
