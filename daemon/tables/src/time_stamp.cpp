#include "time_stamp.hpp"

#include <charconv>
#include <chrono>
#include <vector>

#include "text_lines.hpp"

namespace abbe::daemon {
namespace {

/// The number in a text of at most `most` digits and no other characters.
std::optional<unsigned> digits(std::string_view text, std::size_t most) {
  if (text.empty() || text.size() > most) return std::nullopt;
  unsigned value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

std::optional<std::chrono::sys_days> day_of(std::string_view text) {
  const bool year_first = text.find('-') != std::string_view::npos;
  const auto parts = fields_of(text, year_first ? '-' : '/');
  if (parts.size() != 3) return std::nullopt;
  const auto y = digits(parts[year_first ? 0 : 2], 4), m = digits(parts[year_first ? 1 : 0], 2),
             d = digits(parts[year_first ? 2 : 1], 2);
  if (!y || !m || !d) return std::nullopt;

  constexpr unsigned kCentury = 2000;
  const std::chrono::year_month_day date{
      std::chrono::year{static_cast<int>(*y < 100 ? kCentury + *y : *y)}, std::chrono::month{*m},
      std::chrono::day{*d}};
  if (!date.ok()) return std::nullopt;
  return std::chrono::sys_days{date};
}

std::optional<double> seconds_of_day(std::string_view text) {
  const auto parts = fields_of(text, ':');
  if (parts.size() != 3) return std::nullopt;
  const auto h = digits(parts[0], 2), m = digits(parts[1], 2);
  double s = 0.0;
  const bool starts_with_digit = !parts[2].empty() && parts[2][0] >= '0' && parts[2][0] <= '9';
  if (!h || !m || !starts_with_digit || !protocol::parse_decimal(parts[2], s).empty())
    return std::nullopt;
  if (*h > 23 || *m > 59 || s >= 61.0) return std::nullopt;  // a second of 60 is a leap second
  return 3600.0 * *h + 60.0 * *m + s;
}

}  // namespace

std::optional<double> seconds_of_stamp(std::string_view text) {
  const auto parts = fields_of(text);
  if (parts.size() != 2) return std::nullopt;
  const auto day = day_of(parts[0]);
  const auto time = seconds_of_day(parts[1]);
  if (!day || !time) return std::nullopt;
  const std::chrono::duration<double> since_1970 = day->time_since_epoch();
  return since_1970.count() + *time;
}

}  // namespace abbe::daemon
