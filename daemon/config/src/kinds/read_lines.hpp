#pragma once
/// The keys of a device that sends lines of text.

#include <optional>

#include "abbe/config/kinds/tracker_lines.hpp"
#include "classified_section.hpp"

namespace abbe::daemon {

/// Reads the transport and the format of the lines. Each mistake is a fault of its key.
[[nodiscard]] LinesConfig read_lines(ClassifiedSection& section);
/// Adds a fault for each key of read_lines() that is given although `protocol` is not "lines".
void refuse_lines_keys(ClassifiedSection& section);

}  // namespace abbe::daemon
