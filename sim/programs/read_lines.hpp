#pragma once
/// The keys that every device has that prints lines of text; the same in abbed's file and in [sim].

#include <string>
#include <utility>
#include <vector>

#include "abbe/sim/line_tracker_server.hpp"
#include "toml_file.hpp"

namespace abbe::sim {

/// `transport` and `serial`.
void read_line_output(Section& section, LineOutput& output);
/// `time_unit`, `separator`, `decimal`, `valid_status`.
void read_line_syntax(Section& section, lines::LineSyntax& syntax);
/// `length_unit`, `angle_unit`.
void read_line_units(Section& section, double& metres_per_length, double& radians_per_angle);
/// `key`: a rate, whose period becomes `separation`.
void read_line_rate(Section& section, std::string_view key, std::chrono::nanoseconds& separation);

}  // namespace abbe::sim
