#include "abbe/base/bounded_json.hpp"

#include <fmt/format.h>

#include <string>

#include "abbe/result/try.hpp"

namespace abbe::daemon {
namespace {

using nlohmann::json;

/// Index after the string that begins at `quote`; text.size() if the string is not closed.
std::size_t end_of_string(std::string_view text, std::size_t quote) {
  for (std::size_t i = quote + 1; i < text.size(); ++i) {
    if (text[i] == '\\')
      ++i;
    else if (text[i] == '"')
      return i + 1;
  }
  return text.size();
}

/// Checks nesting depth and number of values. They are counted as a parser would count them; the
/// count stops at the first syntax error in `text`.
Result<void> check_structure(std::string_view text, std::string_view what,
                             const JsonBounds& bounds) {
  std::size_t depth = 0;
  std::size_t values = 1;
  for (std::size_t i = 0; i < text.size();) {
    const char c = text[i];
    if (c == '"') {
      i = end_of_string(text, i);
      continue;
    }
    const bool opens = c == '[' || c == '{';
    if (opens && ++depth > bounds.depth)
      return fail(ErrorCode::BadInput,
                  fmt::format("{}: nested deeper than {} at byte {}", what, bounds.depth, i + 1));
    if ((c == ']' || c == '}') && depth > 0) --depth;
    if ((opens || c == ',') && ++values > bounds.values)
      return fail(ErrorCode::BadInput, fmt::format("{}: more than {} values", what, bounds.values));
    ++i;
  }

  return {};
}

}  // namespace

Result<void> check_json(std::string_view text, std::string_view what, const JsonBounds& bounds) {
  if (text.size() > bounds.bytes)
    return fail(ErrorCode::BadInput,
                fmt::format("{}: {} bytes, at most {} are read", what, text.size(), bounds.bytes));
  return check_structure(text, what, bounds);
}

std::string cause_of(const json::exception& exception) {
  constexpr std::string_view kSyntax = "parse error at ";
  std::string_view text = exception.what();
  if (const auto end = text.find("] "); text.starts_with('[') && end != std::string_view::npos)
    text.remove_prefix(end + 2);
  if (text.starts_with(kSyntax)) text.remove_prefix(kSyntax.size());
  return std::string{text};
}

Result<json> parse_json(std::string_view text, std::string_view what, const JsonBounds& bounds) {
  ABBE_TRY(check_json(text, what, bounds));
  try {
    return json::parse(text);
  } catch (const json::parse_error& error) {
    return fail(ErrorCode::BadInput,
                fmt::format("{}: not JSON at byte {}: {}", what, error.byte, cause_of(error)));
  } catch (const json::exception& error) {  // a number too large for a double
    return fail(ErrorCode::BadInput, fmt::format("{}: {}", what, cause_of(error)));
  }
}

}  // namespace abbe::daemon
