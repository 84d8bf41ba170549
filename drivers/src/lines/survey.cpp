#include "abbe/drivers/lines/survey.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <string_view>
#include <utility>

#include "abbe/protocol/lines/fields.hpp"

namespace abbe::drivers {
namespace {

namespace lines = protocol::lines;
using lines::TimeUnit;
using Columns = std::vector<std::string_view>;

constexpr std::size_t kFewestColumns = 3;  // a point has three coordinates
/// Lines of one burst arrive within this time of each other.
constexpr std::chrono::milliseconds kWithinBurst{10};
/// A column is a time if its rate agrees with that of the arrivals within this fraction. Arrivals
/// of bursts differ by some ms in kShortestSpan; a wrong unit is a factor of 1000.
constexpr double kSameRate = 0.03;
constexpr std::chrono::seconds kShortestSpan{1};
/// A rate this near to a whole number of points per second is that number.
constexpr double kSameStep = 0.05;  // of the mean over all lines

constexpr std::array<LineSplit, 7> kSplits{
    {{'\t', '.'}, {'\t', ','}, {' ', '.'}, {' ', ','}, {';', '.'}, {';', ','}, {',', '.'}}};

Columns columns_of(const std::string& line, const LineSplit& split) {
  Columns columns;
  lines::Fields fields{line, split.separator};
  while (const auto field = fields.next()) columns.push_back(*field);
  if (!columns.empty() && columns.back().empty()) columns.pop_back();
  return columns;
}

/// The lines with the usual number of columns.
struct SplitLines {
  std::size_t column_count = 0;
  std::vector<Columns> rows;
  std::vector<const SurveyedLine*> of;  ///< as rows
};

SplitLines split_lines(const std::vector<SurveyedLine>& all, const LineSplit& split) {
  std::map<std::size_t, std::size_t> counts;
  std::vector<Columns> rows;
  rows.reserve(all.size());
  for (const SurveyedLine& line : all) {
    rows.push_back(columns_of(line.text, split));
    ++counts[rows.back().size()];
  }
  SplitLines out;
  std::size_t most = 0;
  for (const auto& [count, times] : counts)
    if (times > most) std::tie(out.column_count, most) = std::pair{count, times};
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (rows[i].size() != out.column_count) continue;
    out.rows.push_back(std::move(rows[i]));
    out.of.push_back(&all[i]);
  }
  return out;
}

std::size_t columns_of_numbers(const SplitLines& split, char decimal_sign) {
  std::size_t numbers = 0;
  for (std::size_t c = 0; c < split.column_count; ++c)
    numbers += std::ranges::all_of(split.rows,
                                   [&](const Columns& row) {
                                     return lines::number(row[c], decimal_sign).has_value();
                                   })
                   ? 1u
                   : 0u;
  return numbers;
}

/// The splits with most columns of numbers; those that give the same columns count once.
std::vector<LineSplit> best_splits(const std::vector<SurveyedLine>& all) {
  std::size_t most = kFewestColumns - 1;
  std::vector<LineSplit> best;
  std::vector<std::vector<Columns>> rows;
  for (const LineSplit& split : kSplits) {
    auto lines = split_lines(all, split);
    const std::size_t numbers = columns_of_numbers(lines, split.decimal_sign);
    if (numbers < kFewestColumns || numbers < most) continue;
    if (numbers > most) {
      best.clear();
      rows.clear();
    }
    most = numbers;
    if (std::ranges::find(rows, lines.rows) != rows.end()) continue;
    best.push_back(split);
    rows.push_back(std::move(lines.rows));
  }
  return best;
}

std::vector<std::pair<std::string, std::size_t>> words_of(const SplitLines& split, std::size_t c) {
  std::map<std::string_view, std::size_t> counts;
  for (const Columns& row : split.rows) {
    ++counts[row[c]];
    if (counts.size() > SurveyedColumn::kMostWords) return {};
  }
  std::vector<std::pair<std::string, std::size_t>> words{counts.begin(), counts.end()};
  std::ranges::stable_sort(words, std::greater{}, &std::pair<std::string, std::size_t>::second);
  return words;
}

double seconds_of(std::chrono::nanoseconds d) {
  return std::chrono::duration<double>(d).count();
}

double seconds_per(TimeUnit unit) {
  switch (unit) {
    case TimeUnit::Seconds:
      return 1.0;
    case TimeUnit::Milliseconds:
      return 1e-3;
    case TimeUnit::Microseconds:
      return 1e-6;
    case TimeUnit::Nanoseconds:
      break;
  }
  return 1e-9;
}

/// The mean of the differences that are no gaps.
double mean_step(const std::vector<double>& values) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < values.size(); ++i) steps.push_back(values[i] - values[i - 1]);
  if (steps.empty()) return 0.0;
  auto sorted = steps;
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::ranges::nth_element(sorted, middle);
  // Times rounded to a ms differ by one of them; a gap by at least one point.
  const double longest = 1.5 * *middle, shortest = 0.5 * *middle;
  std::erase_if(steps, [&](double step) { return step > longest || step < shortest; });
  return steps.empty()
             ? *middle
             : std::reduce(steps.begin(), steps.end()) / static_cast<double>(steps.size());
}

/// The unit in which `values` rise as the arrivals do, by the last line of each read: lines before
/// it waited for it.
std::optional<TimeUnit> time_unit_of(const std::vector<double>& values,
                                     const std::vector<const SurveyedLine*>& of) {
  std::size_t first = 0;
  while (first + 1 < of.size() && of[first + 1]->read == of[first]->read) ++first;
  const auto span = of.back()->arrival - of[first]->arrival;
  if (span < kShortestSpan) return std::nullopt;
  const double rate = (values.back() - values[first]) / seconds_of(span);
  for (const TimeUnit unit :
       {TimeUnit::Seconds, TimeUnit::Milliseconds, TimeUnit::Microseconds, TimeUnit::Nanoseconds})
    if (std::abs(rate * seconds_per(unit) - 1.0) < kSameRate) return unit;
  return std::nullopt;
}

SurveyedColumn survey_column(const SplitLines& split, std::size_t c, char decimal_sign) {
  SurveyedColumn column;
  column.latest = split.rows.back()[c];
  column.words = words_of(split, c);
  std::vector<double> values;
  for (const Columns& row : split.rows) {
    const auto value = lines::number(row[c], decimal_sign);
    if (!value) {
      column.numbers = false;
      return column;
    }
    values.push_back(*value);
  }
  std::tie(column.least, column.greatest) =
      std::pair{*std::ranges::min_element(values), *std::ranges::max_element(values)};
  column.rises =
      values.size() > 1 && std::ranges::adjacent_find(values, std::greater_equal{}) == values.end();
  if (!column.rises) return column;
  column.step = mean_step(values);
  const bool counts = std::ranges::adjacent_find(
                          values, [](double a, double b) { return b - a != 1.0; }) == values.end();
  if (!counts) column.time = time_unit_of(values, split.of);
  return column;
}

void find_bursts(const std::vector<SurveyedLine>& all, LineFindings& out) {
  std::vector<protocol::HostTime> begins;
  std::vector<std::size_t> sizes;
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (i == 0 || all[i].arrival - all[i - 1].arrival > kWithinBurst) {
      begins.push_back(all[i].arrival);
      sizes.push_back(0);
    }
    ++sizes.back();
  }
  if (sizes.empty()) return;
  out.most_in_burst = *std::ranges::max_element(sizes);
  if (out.most_in_burst < 2 || begins.size() < 3) return;
  std::vector<std::chrono::nanoseconds> periods;
  for (std::size_t i = 1; i < begins.size(); ++i) periods.push_back(begins[i] - begins[i - 1]);
  const auto middle = periods.begin() + static_cast<std::ptrdiff_t>(periods.size() / 2);
  std::ranges::nth_element(periods, middle);
  out.burst_period = *middle;
}

/// 0 unless one column is a time, and its usual step is that of most lines: a sender with jitter
/// has no rate that gaps can be found with.
double point_rate_hz(const std::vector<SurveyedColumn>& columns, std::size_t rows) {
  if (std::ranges::count_if(columns, [](const auto& c) { return c.time.has_value(); }) != 1)
    return 0.0;
  const auto& column =
      *std::ranges::find_if(columns, [](const auto& c) { return c.time.has_value(); });
  const auto steps = static_cast<double>(rows - 1);
  if (std::abs(column.step * steps / (column.greatest - column.least) - 1.0) > kSameStep)
    return 0.0;

  const double rate_hz = 1.0 / (column.step * seconds_per(*column.time));
  const double whole_hz = std::round(rate_hz);
  // At the whole rate the last line would be less than one step from where it is.
  return std::abs(rate_hz / whole_hz - 1.0) * steps < 1.0 ? whole_hz : rate_hz;
}

}  // namespace

LineSurvey::LineSurvey(bool datagrams, bool begins_anywhere) : datagrams_(datagrams) {
  if (begins_anywhere) framer_.resync();
}

void LineSurvey::push(std::span<const std::byte> bytes, protocol::HostTime arrival) {
  framer_.push(bytes);
  ++reads_;
  bool at_end = false;
  for (;;) {
    auto line = framer_.next();
    if (!line && datagrams_ && !std::exchange(at_end, true)) line = framer_.take_incomplete();
    if (!line) return;
    const bool first = std::exchange(first_, false);
    if (line->too_long) {
      ++too_long_;
    } else if (lines::is_comment(line->text)) {
      continue;
    } else if (first && lines::is_heading(line->text)) {
      heading_ = line->text;
    } else if (lines_.size() < kMostLines) {
      lines_.push_back({std::string{line->text}, arrival, reads_});
    }
  }
}

LineFindings LineSurvey::findings(std::optional<LineSplit> split) const {
  LineFindings out;
  out.lines = lines_.size() + too_long_;
  out.heading = heading_;
  out.different = too_long_;
  if (lines_.empty()) return out;
  out.span = lines_.back().arrival - lines_.front().arrival;
  if (out.span.count() > 0)
    out.lines_per_s = static_cast<double>(lines_.size() - 1) / seconds_of(out.span);
  find_bursts(lines_, out);
  out.splits = split ? std::vector{*split} : best_splits(lines_);
  if (out.splits.empty()) {
    out.different = out.lines;
    return out;
  }

  const LineSplit& used = out.splits.front();
  const SplitLines rows = split_lines(lines_, used);
  out.different += lines_.size() - rows.rows.size();
  for (std::size_t c = 0; c < rows.column_count; ++c)
    out.columns.push_back(survey_column(rows, c, used.decimal_sign));
  out.point_rate_hz = point_rate_hz(out.columns, rows.rows.size());
  return out;
}

}  // namespace abbe::drivers
