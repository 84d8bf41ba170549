#include "abbe/protocol/lines/line_framer.hpp"

#include <utility>

namespace abbe::protocol::lines {

std::optional<FramedLine> LineFramer::next() ABBE_RT {
  while (!rest_.empty()) {
    const char c = static_cast<char>(rest_.front());
    rest_ = rest_.subspan(1);
    if (c == '\n' || c == '\r') {
      if (const auto line = complete()) return line;
    } else if (length_ < line_.size()) {
      line_[length_++] = c;
    } else {
      too_long_ = true;
    }
  }
  return std::nullopt;
}

std::optional<FramedLine> LineFramer::take_incomplete() ABBE_RT {
  return complete();
}

std::optional<FramedLine> LineFramer::complete() ABBE_RT {
  const bool skipped = std::exchange(skipping_, false);
  const std::size_t length = std::exchange(length_, 0);
  const bool too_long = std::exchange(too_long_, false);
  if (skipped || length == 0) return std::nullopt;
  return FramedLine{{line_.data(), length}, too_long};
}

void LineFramer::reset() ABBE_RT {
  rest_ = {};
  length_ = 0;
  too_long_ = skipping_ = false;
}

void LineFramer::resync() ABBE_RT {
  reset();
  skipping_ = true;
}

}  // namespace abbe::protocol::lines
