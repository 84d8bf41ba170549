#pragma once
/// Detects times in a file that are not in seconds, for `identify otf`. With such times the model
/// is still correct if only the order of the times is used, but the feed in report and certificate
/// is wrong by the factor of the unit, or the clocks do not fit together. Pure.

#include <filesystem>
#include <span>

#include "abbe/base/error.hpp"
#include "abbe/tables/input_files.hpp"

namespace abbe::daemon {

/// Compares the speed in the file with the feed of the path: at most 20 times as fast or slow.
/// BadInput with file, lines, column, both values, and the unit that would fit. Overrides, ramps
/// and short legs change a speed by less, a wrong unit by 60 or more. For a path without
/// feed_mm_per_min the allowed speeds are 30 mm/min to 200 m/min. The run is divided into at least
/// 500 parts, and at least 20 per vertex. The speed is the median over the parts in which the
/// machine moves; if it moves in none, this is not an error here. Fewer than 4 rows per vertex do
/// not separate moves from dwells; the file is then not compared with the lowest speed.
/// `file`: name in messages.
[[nodiscard]] Result<void> check_time_unit(const std::filesystem::path& file,
                                           const TrackerFile& tracker, const PathFile& path);
[[nodiscard]] Result<void> check_time_unit(const std::filesystem::path& file,
                                           const EncoderFile& encoder, const PathFile& path);

}  // namespace abbe::daemon
