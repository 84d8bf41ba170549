#pragma once
/// Reads a line of I++ DME from the left. Each function is named after an element: it consumes this
/// element if the rest of the line begins with it, and nothing if not.

#include <optional>
#include <string_view>

#include "abbe/protocol/ippdme/lines.hpp"

namespace abbe::protocol::ippdme {

class Scanner {
 public:
  explicit Scanner(std::string_view text) ABBE_RT : rest_(text) {}

  [[nodiscard]] bool at_end() const ABBE_RT { return rest_.empty(); }
  [[nodiscard]] std::string_view rest() const ABBE_RT { return rest_; }
  [[nodiscard]] char peek() const ABBE_RT { return rest_.empty() ? '\0' : rest_.front(); }
  bool take(char c) ABBE_RT;
  void spaces() ABBE_RT;
  /// A comma or parenthesis, with optional spaces before and after it.
  bool separator(char c) ABBE_RT;
  [[nodiscard]] std::optional<Tag> tag() ABBE_RT;
  /// A name, BasicName {"." BasicName}; empty if there is none.
  [[nodiscard]] std::string_view name() ABBE_RT;
  [[nodiscard]] tl::expected<double, LineError> number() ABBE_RT;
  /// A text in quotes, returned without them.
  [[nodiscard]] std::optional<std::string_view> string() ABBE_RT;

 private:
  std::string_view rest_;
};

}  // namespace abbe::protocol::ippdme
