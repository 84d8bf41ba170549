#pragma once
/// A tracker whose points come as lines of text: `protocol = "lines"`. Pure data.

#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/drivers/lines/link.hpp"
#include "abbe/protocol/lines/tracker_line.hpp"

namespace abbe::daemon {

struct LinesConfig {
  drivers::LineAddress address;
  protocol::lines::LineFormat format;
};

/// Keys of the table with the values that a person states; empty or 0: not stated.
struct StatedLines {
  std::string transport = "tcp";
  std::string host, serial;
  int port = 0;
  int baud = 0;
  std::string parity;
  int stop_bits = 0;
  std::vector<std::string> columns, valid_status;
  std::string length_unit, angle_unit, time_unit, separator, decimal;
  std::string weather;
  double point_rate_hz = 0.0;
  int stationary_time_ms = 0;  ///< with mode = "stationary"
};

/// The table of the configuration with these keys.
[[nodiscard]] std::string tracker_table(const StatedLines& stated);
/// The address among these keys, read and checked as that of the table. Error Usage.
[[nodiscard]] Result<drivers::LineAddress> line_address(const StatedLines& stated);

/// The format as the keys of its table, for messages: "time x y z status, mm, s".
[[nodiscard]] std::string format_text(const protocol::lines::LineFormat& format);

}  // namespace abbe::daemon
