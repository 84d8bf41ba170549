#include "abbe/protocol/can/udp_framing.hpp"

#include <algorithm>
#include <limits>
#include <optional>

namespace abbe::protocol::can {

namespace {

constexpr std::uint8_t kVersion = 2;
constexpr std::uint8_t kOpcodeData = 0;
constexpr std::uint8_t kFdBit = 0x80;
// Flag bits of Linux in the identifier word.
constexpr std::uint32_t kExtendedBit = 0x80000000;
constexpr std::uint32_t kRemoteBit = 0x40000000;
constexpr std::uint32_t kErrorBit = 0x20000000;
constexpr std::size_t kIdAndLength = 5;

std::uint8_t byte_at(std::span<const std::byte> bytes, std::size_t i) noexcept {
  return std::to_integer<std::uint8_t>(bytes[i]);
}

/// Decodes one frame from the front of `bytes`; `used` is set to its size in bytes.
std::optional<DatagramError> read_frame(std::span<const std::byte> bytes, CanFrame& frame,
                                        std::size_t& used) noexcept {
  if (bytes.size() < kIdAndLength) return DatagramError::Truncated;
  const auto id = (std::uint32_t{byte_at(bytes, 0)} << 24) |
                  (std::uint32_t{byte_at(bytes, 1)} << 16) |
                  (std::uint32_t{byte_at(bytes, 2)} << 8) | byte_at(bytes, 3);
  const auto length = byte_at(bytes, 4);
  const bool fd = (length & kFdBit) != 0;
  frame = CanFrame{};
  frame.id = id & CanFrame::kExtendedMask;
  frame.length = static_cast<std::uint8_t>(length & ~kFdBit);
  if ((id & kExtendedBit) != 0) frame.set(FrameFlag::Extended);
  if ((id & kRemoteBit) != 0) frame.set(FrameFlag::Remote);
  if ((id & kErrorBit) != 0) frame.set(FrameFlag::Error);
  if (fd) frame.set(FrameFlag::Fd);
  used = kIdAndLength + (fd ? 1u : 0u);

  // CAN FD has no remote frames: such a frame is invalid.
  if (frame.length > (fd ? CanFrame::kMaxData : CanFrame::kMaxClassicData))
    return DatagramError::BadLength;
  if (fd && frame.is(FrameFlag::Remote)) return DatagramError::BadLength;
  const bool long_id = frame.is(FrameFlag::Extended) || frame.is(FrameFlag::Error);
  if (!long_id && frame.id > CanFrame::kStandardMask) return DatagramError::BadId;
  const std::size_t data = frame.is(FrameFlag::Remote) ? 0 : frame.length;
  if (bytes.size() - kIdAndLength < data + (fd ? 1u : 0u)) return DatagramError::Truncated;
  if (fd) frame.fd_flags = byte_at(bytes, kIdAndLength);
  std::copy_n(bytes.begin() + static_cast<std::ptrdiff_t>(used), data, frame.data.begin());
  used += data;

  return std::nullopt;
}

std::uint32_t flagged_id(const CanFrame& frame) noexcept {
  auto id = frame.id & CanFrame::kExtendedMask;
  if (frame.is(FrameFlag::Extended)) id |= kExtendedBit;
  if (frame.is(FrameFlag::Remote)) id |= kRemoteBit;
  if (frame.is(FrameFlag::Error)) id |= kErrorBit;
  return id;
}

/// `length`, limited to the maximum of the frame's format.
std::size_t length_on_wire(const CanFrame& frame) noexcept {
  const auto longest = frame.is(FrameFlag::Fd) ? CanFrame::kMaxData : CanFrame::kMaxClassicData;
  return std::min<std::size_t>(frame.length, longest);
}

}  // namespace

std::size_t encoded_size(const CanFrame& frame) ABBE_RT {
  const std::size_t data = frame.is(FrameFlag::Remote) ? 0 : length_on_wire(frame);
  return kIdAndLength + (frame.is(FrameFlag::Fd) ? 1 : 0) + data;
}

DatagramWriter::DatagramWriter(std::span<std::byte> buffer, std::uint8_t sequence) ABBE_RT
    : buffer_(buffer) {
  buffer_[0] = std::byte{kVersion};
  buffer_[1] = std::byte{kOpcodeData};
  buffer_[2] = std::byte{sequence};
}

bool DatagramWriter::add(const CanFrame& frame) ABBE_RT {
  const auto need = encoded_size(frame);
  if (buffer_.size() - size_ < need || count_ == std::numeric_limits<std::uint16_t>::max())
    return false;

  const auto id = flagged_id(frame);
  auto* out = buffer_.data() + size_;
  for (const int shift : {24, 16, 8, 0}) *out++ = static_cast<std::byte>((id >> shift) & 0xFFu);

  const bool fd = frame.is(FrameFlag::Fd);
  const auto length = length_on_wire(frame);
  *out++ = static_cast<std::byte>(length | (fd ? kFdBit : 0u));
  if (fd) *out++ = std::byte{frame.fd_flags};
  const auto data = frame.payload();
  out = std::copy_n(data.begin(), std::min(data.size(), length), out);

  size_ = static_cast<std::size_t>(out - buffer_.data());
  ++count_;
  return true;
}

std::span<const std::byte> DatagramWriter::finish() ABBE_RT {
  buffer_[3] = static_cast<std::byte>((count_ >> 8) & 0xFFu);
  buffer_[4] = static_cast<std::byte>(count_ & 0xFFu);
  return buffer_.first(size_);
}

const char* to_text(DatagramError error) noexcept {
  switch (error) {
    case DatagramError::TooShort:
      return "shorter than its header";
    case DatagramError::BadVersion:
      return "unknown version";
    case DatagramError::BadOpcode:
      return "unknown opcode";
    case DatagramError::Truncated:
      return "fewer frames than announced";
    case DatagramError::TrailingBytes:
      return "more bytes than announced";
    case DatagramError::BadLength:
      return "frame longer than its format allows";
    case DatagramError::BadId:
      return "identifier longer than its format allows";
  }

  return "unknown error";
}

tl::expected<DatagramView, DatagramError> DatagramView::parse(
    std::span<const std::byte> bytes) ABBE_RT {
  if (bytes.size() < kDatagramHeader) return tl::unexpected(DatagramError::TooShort);
  if (byte_at(bytes, 0) != kVersion) return tl::unexpected(DatagramError::BadVersion);
  if (byte_at(bytes, 1) != kOpcodeData) return tl::unexpected(DatagramError::BadOpcode);
  const auto count = static_cast<std::uint16_t>((byte_at(bytes, 3) << 8) | byte_at(bytes, 4));
  const auto frames = bytes.subspan(kDatagramHeader);
  auto rest = frames;
  CanFrame frame;
  for (unsigned i = 0; i < count; ++i) {
    std::size_t used = 0;
    if (const auto error = read_frame(rest, frame, used)) return tl::unexpected(*error);
    rest = rest.subspan(used);
  }
  if (!rest.empty()) return tl::unexpected(DatagramError::TrailingBytes);
  return DatagramView{frames, byte_at(bytes, 2), count};
}

bool DatagramView::next(CanFrame& frame) ABBE_RT {
  if (left_ == 0) return false;
  --left_;
  std::size_t used = 0;
  // this cannot happen, because parse() has checked all frames
  if (read_frame(rest_, frame, used)) return false;
  rest_ = rest_.subspan(used);
  return true;
}

unsigned SequenceGaps::on_sequence(std::uint8_t sequence) ABBE_RT {
  const auto ahead = static_cast<std::uint8_t>(sequence - expected_);
  if (started_ && ahead >= 128) {
    ++late_;
    return 0;
  }
  const unsigned missing = started_ ? ahead : 0u;
  started_ = true;
  expected_ = static_cast<std::uint8_t>(sequence + 1);
  lost_ += missing;
  return missing;
}

}  // namespace abbe::protocol::can
