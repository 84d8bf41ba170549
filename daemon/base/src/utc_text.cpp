#include "abbe/base/utc_text.hpp"

#include <fmt/format.h>

#include <cstdio>

namespace abbe::daemon {

using namespace std::chrono;

namespace {
/// First and last whole year that 64 bits of nanoseconds since 1970 can represent.
constexpr int first_year = 1678, last_year = 2261;
}  // namespace

std::string to_text(protocol::UtcTime time) {
  const auto day = floor<days>(time);
  const year_month_day date{day};
  const hh_mm_ss clock{time - day};
  return fmt::format("{:04}-{:02}-{:02}T{:02}:{:02}:{:02}.{:09}Z", static_cast<int>(date.year()),
                     static_cast<unsigned>(date.month()), static_cast<unsigned>(date.day()),
                     clock.hours().count(), clock.minutes().count(), clock.seconds().count(),
                     clock.subseconds().count());
}

std::optional<protocol::UtcTime> utc_from_text(std::string_view text) {
  int y = 0;
  unsigned mo = 0, d = 0, h = 0, mi = 0, s = 0, ns = 0;
  char zone = 0;
  const std::string owned{text};
  if (text.size() != 30 || std::sscanf(owned.c_str(), "%4d-%2u-%2uT%2u:%2u:%2u.%9u%c", &y, &mo, &d,
                                       &h, &mi, &s, &ns, &zone) != 8)
    return std::nullopt;
  const year_month_day date{year{y}, month{mo}, day{d}};
  if (y < first_year || y > last_year || !date.ok() || h > 23 || mi > 59 || s > 59)
    return std::nullopt;
  const protocol::UtcTime time =
      sys_days{date} + hours{h} + minutes{mi} + seconds{s} + nanoseconds{ns};
  if (to_text(time) != text) return std::nullopt;  // sscanf also accepts signs and spaces

  return time;
}

}  // namespace abbe::daemon
