#include "abbe/protocol/raw_bytes_cdr.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

namespace abbe::protocol {
namespace {

using tl::unexpected;

constexpr std::array<std::byte, 4> kPlainCdrLe{std::byte{0}, std::byte{1}, std::byte{0},
                                               std::byte{0}};
static_assert(std::endian::native == std::endian::little,
              "integers are copied without byte swapping");

constexpr std::size_t padding(std::size_t position, std::size_t alignment) noexcept {
  return (alignment - position % alignment) % alignment;
}

/// Reads fields of the CDR body; alignment counts from its first byte. After the first failure all
/// values are zero or empty.
class BodyReader {
 public:
  explicit BodyReader(std::span<const std::byte> body) noexcept : body_(body) {}

  template <class T>
  T number() noexcept {
    T value{};
    const auto field = take(sizeof(T) + padding(position_, sizeof(T)));
    if (!field.empty()) std::memcpy(&value, field.data() + field.size() - sizeof(T), sizeof(T));
    return value;
  }
  bool boolean() noexcept {
    const auto value = number<std::uint8_t>();
    if (value > 1) fail(CdrError::BadBool);
    return value == 1;
  }
  std::span<const std::byte> octets(std::size_t bound) noexcept {
    const auto length = number<std::uint32_t>();
    if (length > bound) fail(CdrError::OutOfBounds);
    return take(length);
  }
  std::string_view string(std::size_t bound) noexcept {
    const auto field = octets(bound + 1);  // the length includes the NUL
    if (failed_) return {};
    const std::string_view text{reinterpret_cast<const char*>(field.data()), field.size()};
    if (text.empty() || text.find('\0') != text.size() - 1) {
      fail(CdrError::BadString);
      return {};
    }
    return text.substr(0, text.size() - 1);
  }
  [[nodiscard]] bool failed() const noexcept { return failed_; }
  [[nodiscard]] CdrError error() const noexcept { return error_; }

 private:
  std::span<const std::byte> take(std::size_t size) noexcept {
    if (failed_) return {};
    if (size > body_.size() - position_) {
      fail(CdrError::Truncated);
      return {};
    }
    const auto field = body_.subspan(position_, size);
    position_ += size;
    return field;
  }
  void fail(CdrError error) noexcept {
    if (!failed_) error_ = error;
    failed_ = true;
  }

  std::span<const std::byte> body_;
  std::size_t position_ = 0;
  bool failed_ = false;
  CdrError error_ = CdrError::Truncated;
};

/// Writes fields of the CDR body; alignment counts from its first byte. Precondition: the buffer is
/// large enough for all fields.
class BodyWriter {
 public:
  explicit BodyWriter(std::byte* body) noexcept : body_(body) {}

  template <class T>
  void number(T value) noexcept {
    const std::size_t gap = padding(position_, sizeof(T));
    std::memset(body_ + position_, 0, gap);
    std::memcpy(body_ + position_ + gap, &value, sizeof(T));
    position_ += gap + sizeof(T);
  }
  void octets(std::span<const std::byte> bytes) noexcept {
    number(static_cast<std::uint32_t>(bytes.size()));
    copy(bytes);
  }
  void string(std::string_view text) noexcept {
    number(static_cast<std::uint32_t>(text.size() + 1));
    copy(std::as_bytes(std::span{text.data(), text.size()}));
    number(std::uint8_t{0});
  }
  [[nodiscard]] std::size_t position() const noexcept { return position_; }

 private:
  void copy(std::span<const std::byte> bytes) noexcept {
    std::ranges::copy(bytes, body_ + position_);
    position_ += bytes.size();
  }

  std::byte* body_;
  std::size_t position_ = 0;
};

std::size_t encoded_size(const RawBytes& value) noexcept {
  std::size_t size = 4 + value.device.size() + 1;
  size += padding(size, 8) + 8 + 4 + 1 + 1;
  size += padding(size, 4) + 4 + value.bytes.size();
  return kPlainCdrLe.size() + size;
}

}  // namespace

tl::expected<std::size_t, CdrError> encode_cdr(const RawBytes& value,
                                               std::span<std::byte> out) noexcept {
  if (value.device.size() > kMaxDeviceNameLength || value.bytes.size() > RawBlock::kCapacity) {
    return unexpected(CdrError::OutOfBounds);
  }

  if (value.device.find('\0') != std::string_view::npos) return unexpected(CdrError::BadString);
  if (out.size() < encoded_size(value)) return unexpected(CdrError::BufferTooSmall);
  std::ranges::copy(kPlainCdrLe, out.begin());
  BodyWriter body{out.data() + kPlainCdrLe.size()};
  body.string(value.device);
  body.number(std::int64_t{value.time.time_since_epoch().count()});
  body.number(value.lost_before);
  body.number(static_cast<std::uint8_t>(value.direction == RawBlock::Direction::ToDevice));
  body.number(static_cast<std::uint8_t>(value.continued));
  body.octets(value.bytes);

  return kPlainCdrLe.size() + body.position();
}

tl::expected<RawBytes, CdrError> decode_raw_bytes_cdr(std::span<const std::byte> cdr) noexcept {
  if (cdr.size() < kPlainCdrLe.size()) return unexpected(CdrError::Truncated);
  // The last two bytes of the encapsulation header are options, which a reader must ignore.
  if (cdr[0] != kPlainCdrLe[0] || cdr[1] != kPlainCdrLe[1]) return unexpected(CdrError::NotCdrLe);
  BodyReader body{cdr.subspan(kPlainCdrLe.size())};
  RawBytes value;
  value.device = body.string(kMaxDeviceNameLength);
  value.time = HostTime{std::chrono::nanoseconds{body.number<std::int64_t>()}};
  value.lost_before = body.number<std::uint32_t>();
  value.direction =
      body.boolean() ? RawBlock::Direction::ToDevice : RawBlock::Direction::FromDevice;
  value.continued = body.boolean();
  value.bytes = body.octets(RawBlock::kCapacity);
  if (body.failed()) return unexpected(body.error());

  return value;
}

RawBytes to_raw_bytes(const RawBlock& block, std::string_view device) noexcept {
  const std::size_t length = std::min<std::size_t>(block.length, RawBlock::kCapacity);
  return {device,          block.time,      block.lost_before,
          block.direction, block.continued, std::span{block.bytes}.first(length)};
}

void to_raw_block(const RawBytes& value, RawBlock& block) noexcept {
  const auto bytes = value.bytes.first(std::min(value.bytes.size(), RawBlock::kCapacity));
  block.time = value.time;
  block.lost_before = value.lost_before;
  block.length = static_cast<std::uint16_t>(bytes.size());
  block.continued = value.continued;
  block.direction = value.direction;
  std::ranges::copy(bytes, block.bytes.begin());
}

}  // namespace abbe::protocol
