#include "abbe/tasks/probe_lines.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <span>

#include "abbe/base/printable.hpp"
#include "abbe/devices/tracker_options.hpp"
#include "abbe/drivers/lines/link.hpp"
#include "abbe/protocol/lines/tracker_line.hpp"
#include "abbe/result/try.hpp"

namespace abbe::daemon {
namespace {

namespace lines = protocol::lines;
using lines::Column;

constexpr std::size_t kShownLines = 5;
constexpr std::chrono::milliseconds kLinesCycle{100};
constexpr double kSameValue = 0.02;  // of a rate that is stated

double seconds_of(std::chrono::nanoseconds d) {
  return std::chrono::duration<double>(d).count();
}

tl::unexpected<Error> no_lines(const std::string& where, const std::string& why) {
  return fail(ErrorCode::Io, fmt::format("{}: {}", where, why));
}

/// Receives until the time is over, the progress stops or the connection ends; the latter in
/// ProbedLines::ended.
class Reception {
 public:
  Reception(const ProbeLinesCommand& command, const drivers::LineAddress& address,
            const drivers::TimeSource& time, const Progress& progress)
      : command_(command),
        time_(time),
        progress_(progress),
        link_(address),
        survey_(link_.datagrams(), link_.begins_anywhere()),
        where_(drivers::text_of(address)) {}

  Result<void> run() {
    if (const auto opened = link_.open(); !opened)
      return no_lines(where_, opened.error().text + hint_of_opening());
    const auto began = time_.now();
    while (!progress_.stopped() && ended_.empty()) {
      const auto now = time_.now();
      if (first_ && now - *first_ >= command_.duration) return {};
      if (!first_ && now - began >= command_.longest_wait) return no_lines(where_, why_none());
      show(now, began);
      ABBE_TRY(cycle());
    }
    return {};
  }
  [[nodiscard]] const drivers::LineSurvey& survey() const { return survey_; }
  [[nodiscard]] const std::string& ended() const { return ended_; }

 private:
  Result<void> cycle() {
    const auto ready = link_.wait(kLinesCycle);
    if (!ready) return lost(ready.error().text);
    if (*ready == drivers::LineLink::Ready::Established) connected_ = true;
    if (*ready != drivers::LineLink::Ready::Readable) return {};
    const auto got = link_.read(buffer_);
    if (!got) return lost(got.error().text);
    if (got->bytes == 0) return {};
    bytes_ += got->bytes;
    survey_.push(std::span{buffer_}.first(got->bytes), time_.now());
    if (!first_ && !survey_.lines().empty()) first_ = time_.now();
    return {};
  }
  /// After the first line the end of the connection only ends the reception.
  Result<void> lost(const std::string& why) {
    if (!first_) return no_lines(where_, why);
    ended_ = why;
    return {};
  }
  void show(protocol::HostTime now, protocol::HostTime began) const {
    if (first_)
      progress_.show("receiving lines", seconds_of(now - *first_) / seconds_of(command_.duration));
    else
      progress_.show("waiting for the first line",
                     seconds_of(now - began) / seconds_of(command_.longest_wait));
  }
  [[nodiscard]] std::string hint_of_opening() const {
    return link_.datagrams() || link_.awaits_sender() || link_.begins_anywhere()
               ? "; if abbed or another program uses it, stop that one first"
               : "";
  }
  [[nodiscard]] std::string why_none() const {
    const double wait_s = seconds_of(command_.longest_wait);
    if (bytes_ > 0)
      return fmt::format(
          "{} bytes but no line with a point in {:.3g} s: is this the right port, and for a serial "
          "line the right baud rate? Comments and lines above 512 bytes are no points",
          bytes_, wait_s);
    if (connected_ || !link_.connection_oriented())
      return fmt::format(
          "no line in {:.3g} s: check that the program sends to this address, and "
          "that the tracker measures",
          wait_s);
    return fmt::format("no connection in {:.3g} s", wait_s);
  }

  const ProbeLinesCommand& command_;
  const drivers::TimeSource& time_;
  const Progress& progress_;
  drivers::LineLink link_;
  drivers::LineSurvey survey_;
  std::string where_;
  std::string ended_;
  bool connected_ = false;
  std::size_t bytes_ = 0;
  std::optional<protocol::HostTime> first_;
  std::array<std::byte, 65536> buffer_{};
};

bool names_column(const StatedLines& stated, std::string_view name) {
  return std::ranges::find(stated.columns, name) != stated.columns.end();
}

std::optional<drivers::LineSplit> stated_split(const StatedLines& stated) {
  if (stated.separator.empty()) return std::nullopt;
  drivers::LineSplit split;
  for (const char c : {' ', '\t', ',', ';'})
    if (separator_word(c) == stated.separator) split.separator = c;
  split.decimal_sign = stated.decimal == "comma" ? ',' : '.';
  return split;
}

/// What the lines prove, where a person states nothing.
StatedLines completed(const StatedLines& stated, const drivers::LineFindings& found) {
  StatedLines all = stated;
  if (stated.separator.empty() && found.splits.size() == 1) {
    all.separator = separator_word(found.splits[0].separator);
    if (stated.decimal.empty()) all.decimal = decimal_word(found.splits[0].decimal_sign);
  }
  for (std::size_t i = 0; i < std::min(found.columns.size(), stated.columns.size()); ++i) {
    const auto& column = found.columns[i];
    if (stated.columns[i] != lines::name_of(Column::Time) || !column.time) continue;
    if (stated.time_unit.empty()) all.time_unit = time_unit_word(*column.time);
  }
  if (stated.point_rate_hz == 0.0 && stated.stationary_time_ms == 0)
    all.point_rate_hz = found.point_rate_hz;
  return all;
}

std::string question_of_columns(const drivers::LineFindings& found) {
  std::string example;
  for (const auto& column : found.columns)
    example += fmt::format("{}{}", example.empty() ? "" : ",", column.time ? "time" : "?");
  return fmt::format(
      "--columns: the name of each of the {} columns: time, x, y, z, or range, "
      "azimuth, elevation (or zenith), status, - (ignored){}",
      found.columns.size(), found.point_rate_hz > 0.0 ? "; --columns=" + example : "");
}

std::vector<std::string> missing_of(const StatedLines& stated, bool tracker_frame,
                                    const drivers::LineFindings& found) {
  std::vector<std::string> missing;
  const auto require = [&](bool given, std::string what) {
    if (!given) missing.push_back(std::move(what));
  };
  require(!stated.separator.empty(),
          "--separator, --decimal: the lines can be read in more than one way, or in none");
  require(!stated.columns.empty(), question_of_columns(found));
  require(!stated.length_unit.empty(), "--length-unit: mm, m, um or inch");
  if (names_column(stated, lines::name_of(Column::Azimuth)))
    require(!stated.angle_unit.empty(), "--angle-unit: rad, deg, gon or mrad");
  if (names_column(stated, lines::name_of(Column::Time)))
    require(!stated.time_unit.empty(),
            "--time-unit: s, ms, us or ns; the lines that came do not show it");
  if (names_column(stated, lines::name_of(Column::Status)))
    require(!stated.valid_status.empty(),
            "--valid-status: the words of the status column of points that may be used");
  require(stated.point_rate_hz > 0.0 || stated.stationary_time_ms > 0,
          "--point-rate-hz: points per second; or --stationary-time-ms: each line is a mean over "
          "this time");
  require(!stated.weather.empty(),
          "--weather: compute (the program corrects the distances for measured air) or none");
  require(tracker_frame,
          "--frame tracker: the program sends coordinates in the frame of the tracker itself, z "
          "up, not of a part or an alignment; set it so");
  return missing;
}

std::vector<std::string> contradictions(const StatedLines& stated,
                                        const drivers::LineFindings& found) {
  std::vector<std::string> notes;
  for (std::size_t i = 0; i < std::min(found.columns.size(), stated.columns.size()); ++i) {
    const auto& column = found.columns[i];
    if (stated.columns[i] != lines::name_of(Column::Time)) continue;
    if (!column.rises)
      notes.push_back(fmt::format("column {} is stated as time, but does not rise", i + 1));
    else if (column.time && !stated.time_unit.empty() &&
             stated.time_unit != time_unit_word(*column.time))
      notes.push_back(fmt::format("column {} advances as a time in {}, stated is {}", i + 1,
                                  time_unit_word(*column.time), stated.time_unit));
  }
  if (!stated.columns.empty() && !found.columns.empty() &&
      stated.columns.size() != found.columns.size())
    notes.push_back(fmt::format("{} columns are stated, the lines have {}", stated.columns.size(),
                                found.columns.size()));
  if (stated.point_rate_hz > 0.0 && found.point_rate_hz > 0.0 &&
      std::abs(stated.point_rate_hz / found.point_rate_hz - 1.0) > kSameValue)
    notes.push_back(fmt::format("{:.6g} points per second are stated, the time column shows {:.6g}",
                                stated.point_rate_hz, found.point_rate_hz));
  return notes;
}

std::vector<std::pair<std::string, std::string>> values_of(const lines::TrackerLine& point,
                                                           const lines::LineFormat& format) {
  constexpr double kMmPerMetre = 1e3;
  std::vector<std::pair<std::string, std::string>> values;
  for (int i = 0; i < 3; ++i)
    values.emplace_back(std::string(1, "xyz"[i]),
                        fmt::format("{:.4f} mm", kMmPerMetre * point.p_tracker_m[i]));
  if (point.time)
    values.emplace_back("time",
                        fmt::format("{:.6f} s", seconds_of(point.time->time_since_epoch())));
  if (format.has(Column::Status)) values.emplace_back("status", point.valid ? "valid" : "invalid");
  return values;
}

double distance_m(const lines::TrackerLine& point) {
  return std::hypot(point.p_tracker_m[0], point.p_tracker_m[1], point.p_tracker_m[2]);
}

UnderstoodLines understand(const std::vector<drivers::SurveyedLine>& all,
                           const lines::LineFormat& format) {
  UnderstoodLines out;
  for (const auto& line : all) {
    const auto point = lines::decode(line.text, format);
    if (!point) {
      if (out.unreadable++ == 0)
        out.first_fault =
            fmt::format("column {}: {}: \"{}\"", point.error().column,
                        lines::text_of(point.error().what), printable_line(line.text));
      continue;
    }
    const double here_m = distance_m(*point);
    out.least_distance_m = out.points == 0 ? here_m : std::min(out.least_distance_m, here_m);
    out.greatest_distance_m = std::max(out.greatest_distance_m, here_m);
    ++out.points;
    if (!point->valid) ++out.invalid;
    out.latest = values_of(*point, format);
  }
  return out;
}

/// Everything is stated that a column needs to be read.
bool can_be_read(const StatedLines& stated) {
  const auto needs = [&](Column column, bool given) {
    return given || !names_column(stated, lines::name_of(column));
  };
  return !stated.columns.empty() && !stated.separator.empty() && !stated.length_unit.empty() &&
         needs(Column::Azimuth, !stated.angle_unit.empty()) &&
         needs(Column::Time, !stated.time_unit.empty()) &&
         needs(Column::Status, !stated.valid_status.empty());
}

/// Reads the lines with the table of these statements. What is missing and does not change how a
/// line is read is replaced.
Result<UnderstoodLines> understood_with(StatedLines stated,
                                        const std::vector<drivers::SurveyedLine>& all) {
  if (stated.weather.empty()) stated.weather = "none";
  if (stated.point_rate_hz == 0.0 && stated.stationary_time_ms == 0) {
    if (names_column(stated, lines::name_of(Column::Time)))
      stated.point_rate_hz = 1.0;
    else
      stated.stationary_time_ms = 1;
  }
  auto options = parse_line_options(tracker_table(stated));
  if (!options) {
    options.error().code = ErrorCode::Usage;
    return tl::make_unexpected(options.error());
  }
  return understand(all, options->receiver.format);
}

}  // namespace

std::string time_unit_word(lines::TimeUnit unit) {
  switch (unit) {
    case lines::TimeUnit::Seconds:
      return "s";
    case lines::TimeUnit::Milliseconds:
      return "ms";
    case lines::TimeUnit::Microseconds:
      return "us";
    case lines::TimeUnit::Nanoseconds:
      break;
  }
  return "ns";
}

std::string separator_word(char separator) {
  switch (separator) {
    case '\t':
      return "tab";
    case ',':
      return "comma";
    case ';':
      return "semicolon";
    default:
      return "space";
  }
}

std::string decimal_word(char decimal_sign) {
  return decimal_sign == ',' ? "comma" : "point";
}

Result<ProbedLines> probe_lines(const ProbeLinesCommand& command, const drivers::TimeSource& time,
                                const Progress& progress) {
  const auto address = line_address(command.stated);
  ABBE_TRY(address);
  const auto reception = std::make_unique<Reception>(command, *address, time, progress);
  ABBE_TRY(reception->run());

  ProbedLines out;
  out.where = drivers::text_of(*address);
  out.ended = reception->ended();
  const auto& all = reception->survey().lines();
  for (std::size_t i = all.size() - std::min(all.size(), kShownLines); i < all.size(); ++i)
    out.shown.push_back(all[i].text);
  out.findings = reception->survey().findings(stated_split(command.stated));
  const StatedLines stated = completed(command.stated, out.findings);
  out.notes = contradictions(command.stated, out.findings);
  out.missing = missing_of(stated, command.tracker_frame, out.findings);
  if (can_be_read(stated)) {
    auto understood = understood_with(stated, all);
    ABBE_TRY(understood);
    out.understood = std::move(*understood);
  }

  if (!out.missing.empty()) return out;
  const std::string table = tracker_table(stated);
  if (auto valid = parse_line_options(table); !valid) {
    valid.error().code = ErrorCode::Usage;
    return tl::make_unexpected(valid.error());
  }
  out.table = fmt::format("# From abbe probe-lines, {}: {} lines, {} points.\n{}", out.where,
                          out.findings.lines, out.understood->points, table);
  return out;
}

}  // namespace abbe::daemon
