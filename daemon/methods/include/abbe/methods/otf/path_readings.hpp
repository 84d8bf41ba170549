#pragma once
/// For `identify otf --encoder`: compares the scale readings of a run, from a file, with the
/// vertices of the path. The daemon makes the same comparison live (VertexReadings).

#include <cstddef>
#include <span>
#include <string>

#include "abbe/base/axis_position.hpp"
#include "abbe/base/error.hpp"
#include "abbe/tables/input_files.hpp"

namespace abbe::daemon {

/// Returns the number of vertices at which the machine stood still. Conditions: the readings come
/// within 2 mm of every vertex, in order, and at each standstill they differ from the vertex by at
/// most `tolerance_m`. Otherwise BadInput with the vertex and the axis or the time. `file`: name in
/// messages. Readings before the first vertex and after the last are not used.
[[nodiscard]] Result<std::size_t> compare_with_path(const std::string& file,
                                                    std::span<const EncoderRow> readings,
                                                    std::span<const AxisPosition> path_m,
                                                    double tolerance_m);

}  // namespace abbe::daemon
