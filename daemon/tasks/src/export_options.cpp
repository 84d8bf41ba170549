#include "abbe/tasks/export_options.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "abbe/base/units.hpp"

namespace abbe::daemon {
namespace {

bool is_axis_name(std::string_view name) {
  constexpr std::size_t kLongest = 15;
  const auto letter = [](char c) { return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z'); };
  const auto other = [&](char c) { return letter(c) || (c >= '0' && c <= '9') || c == '_'; };
  return !name.empty() && name.size() <= kLongest && letter(name.front()) &&
         std::all_of(name.begin(), name.end(), other);
}

std::vector<std::string_view> parts_of(std::string_view text) {
  std::vector<std::string_view> parts;
  for (;;) {
    const auto comma = text.find(',');
    parts.push_back(text.substr(0, comma));
    if (comma == std::string_view::npos) return parts;
    text.remove_prefix(comma + 1);
  }
}

}  // namespace

Result<const FormatFacts*> format_of(const std::string& to) {
  const auto* facts = format_named(to);
  if (facts == nullptr)
    return fail(ErrorCode::Usage,
                fmt::format("--to \"{}\": unknown format; known: {}", to, format_names()));
  return facts;
}

Result<std::optional<calib::ExportBox>> volume_of(const std::string& text) {
  if (text.empty()) return std::nullopt;
  const auto parts = parts_of(text);
  std::vector<double> numbers;
  for (const auto part : parts) {
    double value = 0.0;
    const auto [end, fault] = std::from_chars(part.data(), part.data() + part.size(), value);
    if (fault == std::errc{} && end == part.data() + part.size() && std::isfinite(value))
      numbers.push_back(value / kMmPerM);
  }
  if (parts.size() != 6 || numbers.size() != 6)
    return fail(
        ErrorCode::Usage,
        fmt::format("--volume-mm \"{}\": must be xmin,xmax,ymin,ymax,zmin,zmax in mm", text));
  return calib::ExportBox{{numbers[0], numbers[2], numbers[4]},
                          {numbers[1], numbers[3], numbers[5]}};
}

Result<std::array<std::string, 3>> axis_names_of(const std::string& text,
                                                 const FormatFacts& facts) {
  std::array<std::string, 3> names;
  for (std::size_t a = 0; a < 3; ++a) names[a] = facts.axis_names[a];
  if (text.empty()) return names;
  const auto malformed = [&](std::string_view what) {
    return fail(ErrorCode::Usage,
                fmt::format("--axis-map \"{}\": {}, such as X={},Y={},Z={}", text, what,
                            facts.axis_names[0], facts.axis_names[1], facts.axis_names[2]));
  };
  if (!facts.axes_named)
    return fail(ErrorCode::Usage,
                fmt::format("--axis-map: files of {} contain no names of axes", facts.name));

  for (const auto part : parts_of(text)) {
    const bool axis = part.size() > 2 && part[1] == '=' && part[0] >= 'X' && part[0] <= 'Z';
    if (!axis || !is_axis_name(part.substr(2)))
      return malformed("must be names of at most 15 letters and digits for X, Y, Z");
    names[static_cast<std::size_t>(part[0] - 'X')] = part.substr(2);
  }
  if (names[0] == names[1] || names[1] == names[2] || names[0] == names[2])
    return malformed("the names must be different");
  return names;
}

Result<int> positive_moves_of(const std::string& text, const FormatFacts& facts) {
  if (text.empty() && facts.positive_moves != 0) return facts.positive_moves;
  if (text.empty()) {
    Error error{ErrorCode::Usage,
                fmt::format("--to {}: give --positive plus or --positive minus", facts.name)};
    error.details = {
        "public documents do not state in which direction a positive value moves the axis",
        "enter a table of the constant value 0.05 mm, activate it, and read a dial gauge: the axis "
        "moved as in a positive jog: plus; as in a negative jog: minus"};
    return tl::make_unexpected(error);
  }
  if (facts.positive_fixed)
    return fail(ErrorCode::Usage, fmt::format("--positive: the sign of {} is fixed", facts.name));
  if (text == "plus") return 1;
  if (text == "minus") return -1;
  return fail(ErrorCode::Usage, fmt::format("--positive \"{}\": must be plus or minus", text));
}

}  // namespace abbe::daemon
