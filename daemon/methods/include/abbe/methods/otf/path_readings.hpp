#pragma once
/// Readings of the scales along a driven path, from a file, against the vertices of the path: what
/// the daemon does live (VertexReadings), for `identify otf --encoder`.

#include <cstddef>
#include <span>
#include <string>

#include "abbe/base/axis_position.hpp"
#include "abbe/base/error.hpp"
#include "abbe/tables/input_files.hpp"

namespace abbe::daemon {

/// How many vertices the machine stood at, where the readings come within 2 mm of every vertex, in
/// order, and miss none at which it stands by more than `tolerance_m`. BadInput with vertex, axis
/// and time otherwise. `file`: as messages name it. Readings before the first vertex and after the
/// last do not count.
[[nodiscard]] Result<std::size_t> compare_with_path(const std::string& file,
                                                    std::span<const EncoderRow> readings,
                                                    std::span<const AxisPosition> path_m,
                                                    double tolerance_m);

}  // namespace abbe::daemon
