#pragma once
/// JSON from a file or another process. A recursive parser needs stack for each nesting level and
/// memory for each value; so do copying and destroying the parsed value. Therefore levels and
/// values are counted, and limited, before the text is parsed.

#include <cstddef>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "abbe/base/error.hpp"

namespace abbe::daemon {

struct JsonBounds {
  std::size_t bytes = 4u << 20;
  std::size_t depth = 32;  ///< nested arrays and objects; JSON written by abbe has 8 levels at most
  std::size_t values = 1'000'000;  ///< elements of arrays and objects, all levels together
};

/// Checks that `text` has at most the depth and the number of values that `bounds` allows, so that
/// any parser may read it afterwards. The errors are those of parse_json(). Pure; no recursion.
[[nodiscard]] Result<void> check_json(std::string_view text, std::string_view what,
                                      const JsonBounds& bounds);

/// The parsed value, or BadInput with one of the texts
///   "WHAT: nested deeper than 32 at byte 33"
///   "WHAT: not JSON at byte 17: line 2, column 5: syntax error ...; expected ..."
/// Pure; allocates; throws only std::bad_alloc.
[[nodiscard]] Result<nlohmann::json> parse_json(std::string_view text, std::string_view what,
                                                const JsonBounds& bounds = {});

/// The cause that the JSON library reports, without the name of the exception type: "key 'events'
/// not found", or for a syntax error "line 2, column 5: syntax error ...".
[[nodiscard]] std::string cause_of(const nlohmann::json::exception& exception);

}  // namespace abbe::daemon
