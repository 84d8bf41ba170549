#pragma once
/// The nodes of a received ErrorGrid as a lattice to ask and as a file to look at.

#include <filesystem>
#include <span>

#include "abbe/base/error.hpp"
#include "abbe/calib/error_lattice.hpp"
#include "abbe_v1.h"

namespace abbe::dds {

/// Error BadInput as calib::ErrorLattice::create().
[[nodiscard]] daemon::Result<calib::ErrorLattice> lattice_of(std::span<const v1::GridNode> nodes);

/// `x_mm,y_mm,z_mm,ex_um,ey_um,ez_um,ux_um,uy_um,uz_um`, u standard uncertainties. Error Io.
[[nodiscard]] daemon::Result<void> write_grid_csv(const std::filesystem::path& file,
                                                  std::span<const v1::GridNode> nodes);

}  // namespace abbe::dds
