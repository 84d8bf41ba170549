#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace abbe::web {

/// The part of a file that a request asks for.
struct ByteRange {
  std::uint64_t first = 0, bytes = 0;
};

/// The answer to the header Range of a request for a file of `size` bytes ([RFC 9110] 14.1.2,
/// 14.2).
struct RangeAnswer {
  std::optional<ByteRange> part;  ///< absent: the whole file
  bool beyond_end = false;        ///< no byte of the range exists: status 416
};
/// One range "bytes=first-last", "bytes=first-" or "bytes=-number of the last ones". All else,
/// several ranges too, asks for the whole file. Pure; any thread.
[[nodiscard]] RangeAnswer range_answer(std::string_view header, std::uint64_t size);

}  // namespace abbe::web
