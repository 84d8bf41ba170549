#pragma once
/// Reads and writes the fields of a record: little-endian integers; strings, bytes and maps with a
/// u32 length before them.

#include <algorithm>
#include <bit>
#include <concepts>
#include <limits>

#include "abbe/protocol/mcap/records.hpp"

namespace abbe::protocol::mcap {

static_assert(std::endian::native == std::endian::little,
              "integers are copied without byte swapping");

/// Reads fields from the front. Once a field is missing, every later one is zero or empty, and ok()
/// stays false.
class FieldReader {
 public:
  explicit FieldReader(Bytes bytes) noexcept : rest_(bytes) {}

  template <std::unsigned_integral T>
  [[nodiscard]] T integer() noexcept {
    T value = 0;
    const Bytes field = take(sizeof(T));
    if (field.size() == sizeof(T)) std::memcpy(&value, field.data(), sizeof(T));
    return value;
  }
  [[nodiscard]] Bytes bytes() noexcept { return take(integer<std::uint32_t>()); }
  [[nodiscard]] Bytes long_bytes() noexcept { return take(integer<std::uint64_t>()); }
  [[nodiscard]] std::string_view string() noexcept {
    const Bytes field = bytes();
    return {reinterpret_cast<const char*>(field.data()), field.size()};
  }
  /// The remaining bytes, at most `limit`.
  [[nodiscard]] Bytes remainder(
      std::uint64_t limit = std::numeric_limits<std::uint64_t>::max()) noexcept {
    return take(std::min<std::uint64_t>(limit, rest_.size()));
  }
  [[nodiscard]] bool ok() const noexcept { return ok_; }
  [[nodiscard]] bool at_end() const noexcept { return rest_.empty(); }
  [[nodiscard]] std::size_t left() const noexcept { return rest_.size(); }

 private:
  [[nodiscard]] Bytes take(std::uint64_t size) noexcept {
    if (!ok_ || size > rest_.size()) {
      ok_ = false;
      return {};
    }
    const Bytes field = rest_.first(static_cast<std::size_t>(size));
    rest_ = rest_.subspan(field.size());
    return field;
  }

  Bytes rest_;
  bool ok_ = true;
};

template <std::unsigned_integral T>
void append_integer(Buffer& buffer, T value) {
  const auto* first = reinterpret_cast<const std::byte*>(&value);
  buffer.insert(buffer.end(), first, first + sizeof value);
}
inline void append_raw(Buffer& buffer, Bytes bytes) {
  buffer.insert(buffer.end(), bytes.begin(), bytes.end());
}
inline void append_bytes(Buffer& buffer, Bytes bytes) {
  append_integer(buffer, static_cast<std::uint32_t>(bytes.size()));
  append_raw(buffer, bytes);
}
inline void append_string(Buffer& buffer, std::string_view text) {
  append_bytes(buffer, std::as_bytes(std::span{text.data(), text.size()}));
}

/// Writes opcode and a placeholder for the length. The destructor fills in the length.
class RecordScope {
 public:
  RecordScope(Buffer& buffer, Opcode opcode) : buffer_(buffer) {
    append_integer(buffer_, static_cast<std::uint8_t>(opcode));
    append_integer(buffer_, std::uint64_t{0});
    content_ = buffer_.size();
  }
  RecordScope(const RecordScope&) = delete;
  RecordScope& operator=(const RecordScope&) = delete;
  ~RecordScope() {
    const std::uint64_t length = buffer_.size() - content_;
    std::memcpy(&buffer_[content_ - sizeof length], &length, sizeof length);
  }

 private:
  Buffer& buffer_;
  std::size_t content_ = 0;
};

}  // namespace abbe::protocol::mcap
