#pragma once
/// Positions of a file against the travel of [axes].

#include <filesystem>
#include <span>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/calib/geometry.hpp"
#include "abbe/config/config.hpp"

namespace abbe::daemon {

/// BadInput with line and column (x_mm, y_mm, z_mm) of every position outside the travel, and the
/// mistake (an axis reversed, two swapped, another unit) that would put all of them inside.
/// `lines`: of the positions.
[[nodiscard]] Result<void> check_travel(const std::filesystem::path& file,
                                        std::span<const calib::Vector3> positions_m,
                                        std::span<const std::size_t> lines,
                                        const MachineConfig& machine);

}  // namespace abbe::daemon
