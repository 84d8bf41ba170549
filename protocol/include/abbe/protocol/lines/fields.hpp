#pragma once
/// The columns of a line as text, and the number in one. Pure, real time.

#include <cstddef>
#include <optional>
#include <string_view>

#include "abbe/protocol/rt.hpp"

namespace abbe::protocol::lines {

/// The columns of a line, one after the other. `separator` as in LineFormat.
class Fields {
 public:
  Fields(std::string_view line, char separator) ABBE_RT;

  /// Without the blanks around it; nullopt: there is no further column.
  [[nodiscard]] std::optional<std::string_view> next() ABBE_RT;

 private:
  std::string_view rest_;
  char separator_;
};

/// nullopt: `text` is no finite number with this decimal sign, or has more than 40 characters.
[[nodiscard]] std::optional<double> number(std::string_view text, char decimal_sign) ABBE_RT;

}  // namespace abbe::protocol::lines
