#pragma once
/// Checks that the positions in a file are within the travel of [axes].

#include <filesystem>
#include <span>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/calib/geometry/rigid_transform.hpp"
#include "abbe/config/config.hpp"

namespace abbe::daemon {

/// BadInput with line and column (x_mm, y_mm, z_mm) of every position outside the travel. If all
/// positions would be inside after correcting a likely mistake in the file (an axis reversed, two
/// axes swapped, another unit), the text also names this mistake. `lines`: line of each position.
[[nodiscard]] Result<void> check_travel(const std::filesystem::path& file,
                                        std::span<const calib::Vector3> positions_m,
                                        std::span<const std::size_t> lines,
                                        const MachineConfig& machine);

}  // namespace abbe::daemon
