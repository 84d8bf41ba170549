#pragma once
/// Splits a stream of bytes into lines of text. A line ends with LF, CR or CR LF; empty lines are
/// skipped. A line longer than kMaxLine is discarded up to its end and reported once. Real time:
/// fixed memory, no allocation. One thread.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "abbe/protocol/rt.hpp"

namespace abbe::protocol::lines {

/// Longest line without its end, bytes.
inline constexpr std::size_t kMaxLine = 512;

struct FramedLine {
  std::string_view text;  ///< without its end; valid until the next call of next() or reset()
  bool too_long = false;  ///< `text` holds the first kMaxLine bytes, the rest is discarded
};

class LineFramer {
 public:
  /// The bytes of the next read; they must stay valid until next() has returned nullopt.
  void push(std::span<const std::byte> bytes) ABBE_RT { rest_ = bytes; }
  /// The next complete line; nullopt if more bytes are needed.
  [[nodiscard]] std::optional<FramedLine> next() ABBE_RT;
  /// The incomplete line at the end of a datagram: its end is the end of the datagram.
  [[nodiscard]] std::optional<FramedLine> take_incomplete() ABBE_RT;

  /// Discards the incomplete line: the next byte is the first one of a line.
  void reset() ABBE_RT;
  /// Discards everything up to the next end of a line: the stream may begin within a line.
  void resync() ABBE_RT;

 private:
  [[nodiscard]] std::optional<FramedLine> complete() ABBE_RT;

  std::span<const std::byte> rest_;
  std::array<char, kMaxLine> line_{};
  std::size_t length_ = 0;
  bool too_long_ = false;
  bool skipping_ = false;
};

}  // namespace abbe::protocol::lines
