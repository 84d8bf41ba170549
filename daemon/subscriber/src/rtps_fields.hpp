#pragma once
/// Reads and changes fields of RTPS submessages [DDSI-RTPS 2.5, 9.4]. The caller checks lengths.

#include <cstddef>
#include <cstdint>
#include <span>

namespace abbe::dds::rtps_message {

inline constexpr std::size_t kLongestMessage = 65536;  ///< a UDP datagram
inline constexpr std::size_t kHeaderBytes = 20, kSubmessageHeaderBytes = 4, kPrefixAt = 8,
                             kPrefixBytes = 12;
inline constexpr std::uint8_t kPad = 0x01, kAckNack = 0x06, kHeartbeat = 0x07, kGap = 0x08,
                              kInfoTimestamp = 0x09, kInfoSource = 0x0c, kInfoReplyIp4 = 0x0d,
                              kInfoDestination = 0x0e, kInfoReply = 0x0f, kNackFrag = 0x12,
                              kHeartbeatFrag = 0x13, kData = 0x15, kDataFrag = 0x16,
                              kSecureBody = 0x30, kSecurePrefix = 0x31, kSecurePostfix = 0x32,
                              kSecureMessagePrefix = 0x33, kSecureMessagePostfix = 0x34,
                              kStatistics = 0x80;
inline constexpr std::uint8_t kLittleEndian = 0x01, kInlineQos = 0x02, kWithData = 0x04,
                              kWithKey = 0x08, kNoTimestamp = 0x02;

template <class Byte>
class FieldReader {
 public:
  FieldReader(std::span<Byte> bytes, bool little_endian)
      : bytes_(bytes), little_endian_(little_endian) {}
  [[nodiscard]] std::uint16_t u16(std::size_t at) const {
    const unsigned a = bytes_[at], b = bytes_[at + 1];
    return static_cast<std::uint16_t>(little_endian_ ? a | b << 8 : a << 8 | b);
  }
  [[nodiscard]] std::uint32_t u32(std::size_t at) const {
    const std::uint32_t a = u16(at), b = u16(at + 2);
    return little_endian_ ? a | b << 16 : a << 16 | b;
  }
  /// The sequence number at `at`: high word first, in either byte order.
  [[nodiscard]] std::uint64_t sequence_number(std::size_t at) const {
    return std::uint64_t{u32(at)} << 32 | u32(at + 4);
  }
  void put_u16(std::size_t at, std::uint16_t value) {
    const auto low = static_cast<std::uint8_t>(value & 0xff),
               high = static_cast<std::uint8_t>(value >> 8);
    bytes_[at] = little_endian_ ? low : high;
    bytes_[at + 1] = little_endian_ ? high : low;
  }
  void put_u32(std::size_t at, std::uint32_t value) {
    const auto low = static_cast<std::uint16_t>(value & 0xffff),
               high = static_cast<std::uint16_t>(value >> 16);
    put_u16(at, little_endian_ ? low : high);
    put_u16(at + 2, little_endian_ ? high : low);
  }
  void put_sequence_number(std::size_t at, std::uint64_t number) {
    put_u32(at, static_cast<std::uint32_t>(number >> 32));
    put_u32(at + 4, static_cast<std::uint32_t>(number & 0xffff'ffff));
  }
  [[nodiscard]] std::size_t size() const { return bytes_.size(); }

 private:
  std::span<Byte> bytes_;
  bool little_endian_;
};

template <class Byte>
FieldReader(std::span<Byte>, bool) -> FieldReader<Byte>;

}  // namespace abbe::dds::rtps_message
