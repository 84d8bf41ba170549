#include "plausible.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "abbe/base/units.hpp"

namespace abbe::daemon {

void check_travel_length(Section& axis, std::string_view key, const AxisConfig& config) {
  const double travel_m = config.max - config.min;
  if (config.kind != AxisKind::Linear || travel_m <= 0.0 || travel_m >= kShortestTravel_m) return;
  axis.fault(key, fmt::format("the travel is only {:g} mm, but must be at least {:g} mm: the axis "
                              "of no machine is shorter. min_mm and max_mm are in mm",
                              travel_m * kMmPerM, kShortestTravel_m * kMmPerM));
}

void check_step(Section& section, double step, bool linear) {
  if (std::abs(step) <= (linear ? kLargestStep_m : kLargestStep_rad)) return;
  if (linear)
    section.fault("step_nm", fmt::format("one count is {:g} mm, but must be at most {:g} mm: no "
                                         "scale is coarser. step_nm is in nanometres",
                                         step * kMmPerM, kLargestStep_m * kMmPerM));
  else
    section.fault("step_nrad", fmt::format("one count is {:g} rad, but must be at most {:g} rad: "
                                           "no encoder is coarser. step_nrad is in nanoradians",
                                           step, kLargestStep_rad));
}

namespace {

// [RFC 1123] 2.1: length of a host name, and of one label between its dots.
constexpr std::size_t kLongestHost = 253, kLongestLabel = 63;

// Not std::isalnum(), which depends on the locale.
bool is_digit(char c) {
  return c >= '0' && c <= '9';
}

bool is_host_character(char c) {
  return is_digit(c) || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '-' || c == '_';
}

bool is_ipv4(const std::string& host) {
  in_addr address{};
  return ::inet_pton(AF_INET, host.c_str(), &address) == 1;
}

/// With an interface behind '%' if it is a link-local address: "fe80::1%eth0".
bool is_ipv6(const std::string& host) {
  in6_addr address{};
  return ::inet_pton(AF_INET6, host.substr(0, host.find('%')).c_str(), &address) == 1;
}

bool is_label(std::string_view label) {
  return !label.empty() && label.size() <= kLongestLabel && label.front() != '-' &&
         label.back() != '-' && std::ranges::all_of(label, is_host_character);
}

bool is_name(std::string_view host) {
  if (host.ends_with('.')) host.remove_suffix(1);
  if (host.size() > kLongestHost) return false;

  for (;;) {
    const auto dot = host.find('.');
    if (!is_label(host.substr(0, dot))) return false;
    if (dot == std::string_view::npos) return true;
    host.remove_prefix(dot + 1);
  }
}

/// What is wrong with a host; empty if it can be an address or a name.
std::string fault_of_host(const std::string& host) {
  const auto digit_or_dot = [](char c) { return is_digit(c) || c == '.'; };
  if (std::ranges::all_of(host, digit_or_dot))
    return is_ipv4(host) ? "" : "is no IPv4 address: it must be four numbers of 0 to 255";
  if (host.find("://") != std::string::npos) return "is a URL: give only the name or address";
  if (std::ranges::count(host, ':') == 1) return "contains a port: give it as a key of its own";
  if (host.find(':') != std::string::npos) return is_ipv6(host) ? "" : "is no IPv6 address";
  return is_name(host) ? "" : "is no host name: only letters, digits, '-' and '.' are possible";
}

}  // namespace

bool get_host(Section& section, std::string_view key, std::string& out, Need need) {
  if (!section.get(key, out, need)) return false;
  const std::string fault = fault_of_host(out);
  if (!fault.empty()) section.fault(key, fmt::format("\"{}\" {}", out, fault));
  return true;
}

}  // namespace abbe::daemon
