#include "plausible.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "abbe/base/units.hpp"
#include "abbe/protocol/printable.hpp"

namespace abbe::daemon {

void check_travel_length(ClassifiedSection& axis, std::string_view key, const AxisConfig& config) {
  const double travel_m = config.max - config.min;
  if (config.kind != AxisKind::Linear || travel_m <= 0.0 || travel_m >= kShortestTravel_m) return;
  axis.implausible(key,
                   fmt::format("the travel is only {:g} mm, but must be at least {:g} mm: the axis "
                               "of no machine is shorter. min_mm and max_mm are in mm",
                               travel_m * kMmPerM, kShortestTravel_m * kMmPerM));
}

namespace {

bool is_digit(char c) {
  return c >= '0' && c <= '9';
}

/// True for a text of digits and dots with a number above 255, for example 192.168.0.300. Such a
/// text is a mistyped address, because a host name never consists of digits and dots only.
bool has_number_over_255(std::string_view host) {
  constexpr int kMost = 255;
  int number = 0;
  for (const char c : host) {
    number = c == '.' ? 0 : 10 * number + (c - '0');
    if (number > kMost) return true;
  }
  return false;
}

/// The reason why no resolver can accept `host`; empty if it may be an address or a name.
/// Properties that only a resolver can check are not checked: leading zeros in a number, names in
/// /etc/hosts, mDNS.
std::string fault_of_host(const std::string& host) {
  const auto digit_or_dot = [](char c) { return is_digit(c) || c == '.'; };
  const auto not_printable = [](char c) { return c == ' ' || c == '\x7f' || (c >= 0 && c < ' '); };
  const bool dots = host.find('.') != std::string::npos;

  if (std::ranges::any_of(host, not_printable)) return "contains a blank or a control character";
  if (host.find("://") != std::string::npos) return "is a URL: give only the name or address";
  if (std::ranges::count(host, ':') == 1) return "contains a port: give it as a key of its own";
  if (dots && std::ranges::all_of(host, digit_or_dot) && has_number_over_255(host))
    return "is no IPv4 address: its numbers must be 0 to 255";
  return "";
}

}  // namespace

bool get_host(ClassifiedSection& section, Key key, std::string& out, Need need) {
  if (!section.get(key, out, need)) return false;
  const std::string fault = fault_of_host(out);
  if (!fault.empty())
    section.implausible(key.name, fmt::format("\"{}\" {}", protocol::printable_line(out), fault));
  return true;
}

}  // namespace abbe::daemon
