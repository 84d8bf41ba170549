#pragma once
/// The keys of a device that sends lines of text. Each mistake is a fault of its key.

#include <string_view>
#include <utility>
#include <vector>

#include "abbe/config/kinds/tracker_lines.hpp"
#include "abbe/protocol/lines/line_format.hpp"
#include "classified_section.hpp"

namespace abbe::daemon {

/// Reads the transport and the format of the lines of a tracker.
[[nodiscard]] LinesConfig read_lines(ClassifiedSection& section);
/// Adds a fault for each key of read_lines() that is given although `protocol` is not "lines".
void refuse_lines_keys(ClassifiedSection& section);

/// Reads the transport of lines of any content.
[[nodiscard]] drivers::LineAddress read_line_address(ClassifiedSection& section);
/// Reads `time_unit`, `separator`, `decimal` and `valid_status`. `role`: of the keys on which the
/// meaning of a value depends.
void read_line_syntax(ClassifiedSection& section, Role role, bool has_status,
                      protocol::lines::LineSyntax& format);
/// Words of `length_unit` and `angle_unit` with the unit in m or rad.
[[nodiscard]] const std::vector<std::pair<std::string_view, double>>& line_length_units();
[[nodiscard]] const std::vector<std::pair<std::string_view, double>>& line_angle_units();

}  // namespace abbe::daemon
