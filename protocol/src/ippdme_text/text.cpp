// Encoding of I++ DME text. It allocates, so it is separate from the decoders of the real-time
// path.
#include <algorithm>
#include <cstdio>

#include "abbe/protocol/ippdme/lines.hpp"

namespace abbe::protocol::ippdme {

std::string to_string(Tag tag) {
  const std::string digits = std::to_string(tag.number);
  const std::size_t width = tag.event ? 4 : 5;
  return (tag.event ? "E" : "") + std::string(width - std::min(width, digits.size()), '0') + digits;
}

std::optional<std::string> number_text(double value) {
  if (!(value > -1e15 && value < 1e15)) return std::nullopt;
  char text[40];
  // Nine decimals of 1 mm are 1 pm; lengths below 10 km then have at most 16 digits.
  const int decimals = value > -1e6 && value < 1e6 ? 9 : 0;
  const int n = std::snprintf(text, sizeof text, "%.*f", decimals, value);
  std::string s(text, static_cast<std::size_t>(n));
  if (decimals > 0) {
    s.erase(s.find_last_not_of('0') + 1);
    if (s.back() == '.') s.pop_back();
  }
  return s == "-0" ? "0" : s;
}

}  // namespace abbe::protocol::ippdme
