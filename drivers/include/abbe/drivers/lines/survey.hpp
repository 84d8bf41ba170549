#pragma once
/// What the lines of an unknown sender have in common: separator, number of columns, rate, bursts,
/// and which column is a time. A finding is one that the lines prove; what they leave open is left
/// open. Units of lengths and angles, and which column is x, are never found. Sans-I/O: bytes with
/// their arrival times in. Not real-time. One thread.

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/protocol/lines/line_framer.hpp"
#include "abbe/protocol/lines/tracker_line.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::drivers {

struct SurveyedLine {
  std::string text;
  protocol::HostTime arrival{};
  std::size_t read = 0;  ///< number of the read that completed it
};

/// A column over all lines that have the usual number of columns.
struct SurveyedColumn {
  std::string latest;
  bool numbers = true;  ///< every value is a number
  double least = 0.0;   ///< of a column of numbers
  double greatest = 0.0;
  bool rises = false;  ///< of a column of numbers: from each line to the next
  /// The column rises as time passes, in this unit. nullopt: it does not, or it may be a counter of
  /// the lines, or the lines came for too short a time.
  std::optional<protocol::lines::TimeUnit> time;
  /// Mean difference from line to line, without gaps; of a column that rises.
  double step = 0.0;
  /// The different values and how often they came, the most frequent first; empty if there are more
  /// than kMostWords.
  std::vector<std::pair<std::string, std::size_t>> words;
  static constexpr std::size_t kMostWords = 8;
};

/// How a line is split.
struct LineSplit {
  char separator = ' ';
  char decimal_sign = '.';
  friend bool operator==(const LineSplit&, const LineSplit&) = default;
};

struct LineFindings {
  std::size_t lines = 0;            ///< without headings and comments
  std::string heading;              ///< names of columns in the first line; empty: none
  std::size_t different = 0;        ///< lines with another number of columns, or too long
  std::chrono::nanoseconds span{};  ///< from the first arrival to the last
  /// The splits by which most columns are numbers in the same number of columns. One: proven.
  std::vector<LineSplit> splits;
  std::vector<SurveyedColumn> columns;  ///< by the first of `splits`

  double lines_per_s = 0.0;
  /// Median time between bursts of more than one line; 0: lines come one by one.
  std::chrono::nanoseconds burst_period{};
  std::size_t most_in_burst = 0;
  /// By the column that is proven to be the time, if it is the only one; else 0.
  double point_rate_hz = 0.0;
};

class LineSurvey {
 public:
  /// As in LineReceiverOptions.
  LineSurvey(bool datagrams, bool begins_anywhere);

  /// All bytes of one read and their arrival time. At most kMostLines lines are kept.
  void push(std::span<const std::byte> bytes, protocol::HostTime arrival);
  /// Comments and headings excluded.
  [[nodiscard]] const std::vector<SurveyedLine>& lines() const noexcept { return lines_; }
  static constexpr std::size_t kMostLines = 200'000;

  /// `split`: as stated by a person; nullopt: found.
  [[nodiscard]] LineFindings findings(std::optional<LineSplit> split = {}) const;

 private:
  bool datagrams_;
  protocol::lines::LineFramer framer_;
  std::vector<SurveyedLine> lines_;
  std::string heading_;
  std::size_t too_long_ = 0;
  std::size_t reads_ = 0;
  bool first_ = true;
};

}  // namespace abbe::drivers
