#pragma once
/// JSON from a file or another process. A parser that recurses, and every copy and destruction of
/// what it made, needs stack for each level and memory for each value, so both are counted before
/// anything is parsed.

#include <cstddef>
#include <nlohmann/json.hpp>
#include <string_view>

#include "abbe/base/error.hpp"

namespace abbe::daemon {

struct JsonBounds {
  std::size_t bytes = 4u << 20;
  std::size_t depth = 32;  ///< nested arrays and objects; nothing abbe writes is deeper than 8
  std::size_t values = 1'000'000;  ///< of arrays and objects, all levels together
};

/// Whether `text` is within `bounds`, whatever parses it then. Errors as of parse_json(). Pure; no
/// recursion.
[[nodiscard]] Result<void> check_json(std::string_view text, std::string_view what,
                                      const JsonBounds& bounds);

/// Else BadInput: "WHAT: nested deeper than 32 at byte 33", "WHAT: not JSON at byte 17: unexpected
/// ...". Pure; allocates; never throws but for lack of memory.
[[nodiscard]] Result<nlohmann::json> parse_json(std::string_view text, std::string_view what,
                                                const JsonBounds& bounds = {});

}  // namespace abbe::daemon
