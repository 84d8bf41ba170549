#pragma once
/// RTPS messages for the tests of the message filter, octet by octet.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace abbe::dds::test_messages {

using Bytes = std::vector<std::uint8_t>;

inline constexpr std::uint8_t kPublications = 0x03, kSubscriptions = 0x04, kSomebodys = 0x12;
inline constexpr std::uint16_t kTypeObject = 0x0072, kTypeInformation = 0x0075,
                               kDurability = 0x001d;

inline void append_u16(Bytes& out, std::uint16_t v, bool little_endian = true) {
  const auto low = static_cast<std::uint8_t>(v & 0xff), high = static_cast<std::uint8_t>(v >> 8);
  out.insert(out.end(), {little_endian ? low : high, little_endian ? high : low});
}

/// A DATA submessage of `writer` with `rest` behind its sequence number.
inline Bytes data_message(std::uint8_t writer, std::uint8_t flags, std::uint16_t to_inline_qos,
                          const Bytes& rest, std::uint8_t kind = 0x15) {
  const bool little_endian = (flags & 1) != 0;
  Bytes body{0, 0};  // extra flags
  append_u16(body, to_inline_qos, little_endian);
  body.insert(body.end(), {0, 0, 0, 0, 0, 0, writer, 0xc2, 0, 0, 0, 0, 1, 0, 0, 0});
  body.insert(body.end(), rest.begin(), rest.end());
  Bytes message{'R', 'T', 'P', 'S', 2, 3, 1, 15, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0};
  message.insert(message.end(), {kind, flags});
  append_u16(message, static_cast<std::uint16_t>(body.size()), little_endian);
  message.insert(message.end(), body.begin(), body.end());
  return message;
}

/// One DATA submessage with a list of parameters, each of four bytes.
inline Bytes announcement(std::uint8_t writer, const std::vector<std::uint16_t>& parameters,
                          bool little_endian = true, std::uint8_t kind = 0x15) {
  Bytes list{0, static_cast<std::uint8_t>(little_endian ? 3 : 2), 0, 0};
  for (const auto id : parameters) {
    append_u16(list, id, little_endian);
    append_u16(list, 4, little_endian);
    list.insert(list.end(), {1, 2, 3, 4});
  }
  append_u16(list, 1, little_endian);
  append_u16(list, 0, little_endian);
  return data_message(writer, little_endian ? 5 : 4, 16, list, kind);
}

/// A submessage of a user's writer, entity 00000102.
inline Bytes users_data(std::uint8_t flags, const Bytes& rest, std::uint8_t kind = 0x15) {
  Bytes message = data_message(kSomebodys, flags, 16, rest, kind);
  message[34] = 1, message[35] = 2;  // its writer id: 00 00 01 02
  return message;
}
inline constexpr std::size_t kKindAt = 20, kBodyAt = 24;
inline const Bytes kDisposed{0x71, 0, 4, 0, 0, 0, 0, 1, 1, 0, 0, 0};

inline const Bytes kAuthentication{0, 2, 1, 0xc3}, kKeys{0xff, 2, 2, 0xc3};  // writers

/// Fragments `first` to `first` + `count` - 1 of a sample, each of 64 bytes.
inline Bytes fragment_message(const Bytes& writer, std::uint8_t first, std::uint8_t count,
                              std::uint8_t sample_size, const Bytes& payload) {
  Bytes rest{first, 0, 0, 0, count, 0, 64, 0, sample_size, 0, 0, 0};
  rest.insert(rest.end(), payload.begin(), payload.end());
  Bytes message = data_message(0, 1, 28, rest, 0x16);
  std::copy(writer.begin(), writer.end(), &message[kBodyAt + 8]);
  return message;
}

inline Bytes gap_message(std::uint32_t start, std::uint32_t base) {
  Bytes message = users_data(1, Bytes(12), 0x08);
  Bytes body{0, 0, 0, 0, 0, 0, 1, 2};
  for (const auto number : {0u, start, 0u, base, 0u})
    for (int i = 0; i < 4; ++i) body.push_back(static_cast<std::uint8_t>(number >> (8 * i)));
  message.resize(kBodyAt);
  message.insert(message.end(), body.begin(), body.end());
  message[kKindAt + 2] = static_cast<std::uint8_t>(body.size());
  return message;
}

}  // namespace abbe::dds::test_messages
