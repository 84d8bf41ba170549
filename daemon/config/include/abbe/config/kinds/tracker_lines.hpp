#pragma once
/// A tracker whose points come as lines of text: `protocol = "lines"`. Pure data.

#include <chrono>
#include <string>

#include "abbe/drivers/lines/link.hpp"
#include "abbe/protocol/lines/tracker_line.hpp"

namespace abbe::daemon {

struct LinesConfig {
  drivers::LineAddress address;
  protocol::lines::LineFormat format;
};

/// The format as the keys of its table, for messages: "time x y z status, mm, s".
[[nodiscard]] std::string format_text(const protocol::lines::LineFormat& format);

}  // namespace abbe::daemon
