#include "byte_range.hpp"

#include <algorithm>
#include <charconv>

namespace abbe::web {
namespace {

/// Nullopt if there is anything but digits, or a number above 2^64 - 1.
std::optional<std::uint64_t> number(std::string_view text) {
  std::uint64_t value = 0;
  const auto read = std::from_chars(text.data(), text.data() + text.size(), value);
  if (text.empty() || read.ec != std::errc{} || read.ptr != text.data() + text.size())
    return std::nullopt;
  return value;
}

}  // namespace

RangeAnswer range_answer(std::string_view header, std::uint64_t size) {
  constexpr std::string_view kUnit = "bytes=";
  if (!header.starts_with(kUnit)) return {};
  header.remove_prefix(kUnit.size());
  const auto dash = header.find('-');
  if (dash == std::string_view::npos) return {};
  const std::string_view from = header.substr(0, dash), to = header.substr(dash + 1);

  if (from.empty()) {
    const auto last_ones = number(to);
    if (!last_ones) return {};
    if (*last_ones == 0 || size == 0) return {.part = {}, .beyond_end = true};
    const std::uint64_t bytes = std::min(*last_ones, size);
    return {.part = ByteRange{size - bytes, bytes}};
  }
  const auto first = number(from);
  const auto last = to.empty() ? std::optional<std::uint64_t>{UINT64_MAX} : number(to);
  if (!first || !last || *last < *first) return {};
  if (*first >= size) return {.part = {}, .beyond_end = true};
  return {.part = ByteRange{*first, std::min(*last, size - 1) - *first + 1}};
}

}  // namespace abbe::web
