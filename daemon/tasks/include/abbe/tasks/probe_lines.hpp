#pragma once
/// Receives the lines of a program for some seconds, as the tracker driver does, and states what
/// they are; with what a person states beside them, gives the table of the configuration.

#include <chrono>
#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/config/kinds/tracker_lines.hpp"
#include "abbe/drivers/lines/survey.hpp"
#include "abbe/drivers/time_source.hpp"
#include "abbe/tasks/progress.hpp"

namespace abbe::daemon {

struct ProbeLinesCommand {
  StatedLines stated;
  /// The coordinates are those of the tracker itself, not of a work piece or an alignment.
  bool tracker_frame = false;
  std::chrono::nanoseconds duration = std::chrono::seconds{5};       ///< from the first line on
  std::chrono::nanoseconds longest_wait = std::chrono::seconds{30};  ///< for the first line
};

/// The lines as the driver would read them with the stated columns.
struct UnderstoodLines {
  std::size_t points = 0;   ///< with those that are not valid
  std::size_t invalid = 0;  ///< by their status
  std::size_t unreadable = 0;
  std::string first_fault;  ///< of an unreadable line: column, reason and text
  /// Of the latest point: column and value with its unit, "x" and "1523.1042 mm".
  std::vector<std::pair<std::string, std::string>> latest;
  double least_distance_m = 0.0;  ///< from the tracker
  double greatest_distance_m = 0.0;
};

struct ProbedLines {
  std::string where;  ///< "10.0.0.7:7001"
  std::string ended;  ///< why before its time: "connection closed by the peer"; or empty
  std::vector<std::string> shown;  ///< the latest lines as received
  drivers::LineFindings findings;
  /// If all is stated that a column needs to be read.
  std::optional<UnderstoodLines> understood;
  std::vector<std::string> notes;    ///< contradictions between the lines and what is stated
  std::vector<std::string> missing;  ///< what a person must state before there is a table
  std::string table;                 ///< as abbed reads it; empty if anything is missing
};

/// Error Usage: what is stated is not possible. Io: no connection, no line. When `progress` stops,
/// the lines received until then are used.
[[nodiscard]] Result<ProbedLines> probe_lines(const ProbeLinesCommand& command,
                                              const drivers::TimeSource& time,
                                              const Progress& progress);

/// "s", "ms", ...: as in the configuration.
[[nodiscard]] std::string time_unit_word(protocol::lines::TimeUnit unit);
/// "space", "tab", ...; "point", "comma".
[[nodiscard]] std::string separator_word(char separator);
[[nodiscard]] std::string decimal_word(char decimal_sign);

}  // namespace abbe::daemon
