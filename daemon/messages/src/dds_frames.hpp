#pragma once
/// The frames on the local socket from abbed to abbe-dds: a header of 16 bytes, then a payload.
/// abbe-dds answers each beat with the byte 00. It reports another publisher that claims to be this
/// machine with the byte 01, the length of the text in two bytes (little endian), and the text.
///
///   bytes 0..3  length of the payload, little endian
///   byte  4     kind
///   byte  5     topic (kind Publish, else 0)
///   bytes 6..7  version of this format
///   bytes 8..15 time of sending, ns of CLOCK_MONOTONIC (common to both processes), little endian
///
/// A frame may wait in the socket for seconds. The receiver therefore uses the time of sending, not
/// the time of reading. Sans-I/O; single-threaded.

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/messages/topics.hpp"

namespace abbe::daemon {

inline constexpr std::size_t kFrameHeaderBytes = 16;
inline constexpr std::uint8_t kFrameVersion = 2;
/// The largest payload, ErrorModel with 1024 parameters, is below 52 kB.
inline constexpr std::size_t kMaxPayloadBytes = std::size_t{64} * 1024;

enum class FrameKind : std::uint8_t { Beat = 0, Publish = 1 };

using FrameInstant = std::chrono::time_point<std::chrono::steady_clock, std::chrono::nanoseconds>;

struct Frame {
  FrameKind kind = FrameKind::Beat;
  Topic topic = Topic::Snapshot;
  FrameInstant at{};
  std::span<const std::byte> payload;
};

/// One frame. `payload` is a part of the reader's buffer, so the caller may change the payload
/// before forwarding it.
struct ReceivedFrame {
  FrameKind kind = FrameKind::Beat;
  Topic topic = Topic::Snapshot;
  FrameInstant at{};
  std::span<std::byte> payload;
};

inline constexpr std::byte kAnswerAlive{0}, kAnswerTwin{1};
// same bound as in the IDL, Identity::twin_seen
inline constexpr std::size_t kLongestTwinText = 256;

/// Reads what abbe-dds sends. Sans-I/O.
class AnswerReader {
 public:
  void take(std::span<const std::byte> bytes) {
    for (const std::byte b : bytes) take(b);
  }
  /// The last report; empty: no other publisher claims to be this machine.
  [[nodiscard]] const std::string& twin() const noexcept { return twin_; }

 private:
  void take(std::byte b) {
    if (header_left_ > 0) {
      length_ |= std::to_integer<std::size_t>(b) << (header_left_ == 2 ? 0 : 8);
      if (--header_left_ == 0) text_.clear();
    } else if (length_ > 0) {
      --length_;
      if (text_.size() < kLongestTwinText) text_.push_back(std::to_integer<char>(b));
    } else if (b == kAnswerTwin) {
      header_left_ = 2;
      in_text_ = true;
    }
    if (in_text_ && header_left_ == 0 && length_ == 0) {
      twin_ = text_;
      in_text_ = false;
    }
  }

  int header_left_ = 0;
  std::size_t length_ = 0;
  bool in_text_ = false;
  std::string text_, twin_;
};

/// The report in the form that AnswerReader reads; a text that is too long is truncated.
inline std::vector<std::byte> twin_report(std::string_view text) {
  text = text.substr(0, kLongestTwinText);
  std::vector<std::byte> bytes{kAnswerTwin, static_cast<std::byte>(text.size() & 0xffu),
                               static_cast<std::byte>(text.size() >> 8)};
  for (const char c : text) bytes.push_back(static_cast<std::byte>(c));
  return bytes;
}

inline void append_frame(std::vector<std::byte>& out, const Frame& frame) {
  const auto n = static_cast<std::uint32_t>(frame.payload.size());
  const auto byte = [](std::uint64_t v) { return static_cast<std::byte>(v & 0xffu); };
  std::array<std::byte, kFrameHeaderBytes> header{byte(n),
                                                  byte(n >> 8),
                                                  byte(n >> 16),
                                                  byte(n >> 24),
                                                  byte(static_cast<std::uint32_t>(frame.kind)),
                                                  byte(static_cast<std::uint32_t>(frame.topic)),
                                                  byte(kFrameVersion),
                                                  byte(0)};
  const auto at = static_cast<std::uint64_t>(frame.at.time_since_epoch().count());

  for (std::size_t i = 0; i < 8; ++i) header[8 + i] = byte(at >> (8 * i));
  out.insert(out.end(), header.begin(), header.end());
  out.insert(out.end(), frame.payload.begin(), frame.payload.end());
}

/// Splits bytes into frames. If broken() is true, the stream is malformed and the caller must close
/// the connection.
class FrameReader {
 public:
  /// The buffer for the next read. Afterwards pass the number of bytes read to filled().
  [[nodiscard]] std::span<std::byte> room() {
    if (end_ == buffer_.size() || begin_ == end_) {
      std::memmove(buffer_.data(), buffer_.data() + begin_, end_ - begin_);
      end_ -= begin_;
      begin_ = 0;
    }
    return std::span(buffer_).subspan(end_);
  }
  void filled(std::size_t bytes) { end_ += bytes; }

  /// The next complete frame, or nullopt. Its payload is valid until the next call of room().
  [[nodiscard]] std::optional<ReceivedFrame> next() {
    const auto waiting = std::span<std::byte>(buffer_).subspan(begin_, end_ - begin_);
    if (broken_ || waiting.size() < kFrameHeaderBytes) return std::nullopt;
    std::size_t length = 0;
    for (std::size_t i = 0; i < 4; ++i)
      length |= std::to_integer<std::size_t>(waiting[i]) << (8 * i);
    const auto kind = std::to_integer<std::uint8_t>(waiting[4]);
    const auto topic = topic_from(std::to_integer<std::uint8_t>(waiting[5]));
    const auto version = std::to_integer<std::uint8_t>(waiting[6]);
    broken_ = length > kMaxPayloadBytes || kind > 1 || !topic || version != kFrameVersion;
    if (broken_ || waiting.size() < kFrameHeaderBytes + length) return std::nullopt;
    begin_ += kFrameHeaderBytes + length;

    return ReceivedFrame{static_cast<FrameKind>(kind), *topic, instant(waiting),
                         waiting.subspan(kFrameHeaderBytes, length)};
  }

  [[nodiscard]] bool broken() const noexcept { return broken_; }

 private:
  static FrameInstant instant(std::span<const std::byte> header) {
    std::uint64_t ns = 0;
    for (std::size_t i = 0; i < 8; ++i)
      ns |= std::to_integer<std::uint64_t>(header[8 + i]) << (8 * i);
    return FrameInstant{std::chrono::nanoseconds{static_cast<std::int64_t>(ns)}};
  }

  std::vector<std::byte> buffer_ =
      std::vector<std::byte>(2 * (kFrameHeaderBytes + kMaxPayloadBytes));
  std::size_t begin_ = 0;
  std::size_t end_ = 0;
  bool broken_ = false;
};

}  // namespace abbe::daemon
