#pragma once
/// Finds times of a file that are not in seconds, for `identify otf`. Such times give a right model
/// as long as only their order counts, but a feed in report and certificate that is wrong by the
/// unit, or clocks that do not fit. Pure.

#include <filesystem>
#include <span>

#include "abbe/base/error.hpp"
#include "abbe/tables/input_files.hpp"

namespace abbe::daemon {

/// Compares the speed in the file with the feed of the path: at most 20 times as fast or slow.
/// BadInput with file, lines, column, both values, and the unit that would fit. Overrides, ramps
/// and short legs change a speed by less, a wrong unit by 60 or more. A path without
/// feed_mm_per_min: 30 mm/min to 200 m/min. The speed is the median of those of the parts of the
/// run in which the machine moves, of at least 500 and 20 per vertex; no part that moves is no
/// error here. Rows that are fewer than 4 per vertex do not separate moves from dwells: then the
/// file is not compared with the lowest speed.
/// `file`: name in messages.
[[nodiscard]] Result<void> check_time_unit(const std::filesystem::path& file,
                                           const TrackerFile& tracker, const PathFile& path);
[[nodiscard]] Result<void> check_time_unit(const std::filesystem::path& file,
                                           const EncoderFile& encoder, const PathFile& path);

}  // namespace abbe::daemon
