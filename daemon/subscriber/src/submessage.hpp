#pragma once
/// A submessage of an RTPS message, as the filter reads and changes it [DDSI-RTPS 2.5, 8.3.7,
/// 9.4.5].

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "abbe/subscriber/message_filter.hpp"
#include "rtps_fields.hpp"

namespace abbe::dds::rtps_message {

using Bytes = std::span<std::uint8_t>;
using Reader = FieldReader<std::uint8_t>;

/// Replaces the kind of a submessage that must not be read. The kind is not assigned, so a receiver
/// skips the submessage [DDSI-RTPS 2.5, 9.4.5.1.1].
inline constexpr std::uint8_t kSkipped = 0x7f;
/// octetsToInlineQos counts from the end of its own field.
inline constexpr std::size_t kToInlineQos = 4;
/// Replaces the id of a parameter that must not be read. This id is vendor-specific and has no bit
/// "must understand", so a receiver skips a parameter with it.
inline constexpr std::uint16_t kUnusedParameterId = 0xbfff;

/// A submessage, to be changed in place: its kind and flags in the header, and its body.
struct Submessage {
  std::uint8_t& kind;
  std::uint8_t& flags;
  Bytes body;
  /// Signed by DDS Security: a change would make the receiver drop the submessage. Its sender is
  /// trusted.
  bool is_signed = false;
  /// header of the RTPS message, with the GUID prefix of the sender
  std::span<const std::uint8_t, kHeaderBytes> header;
  const SequenceWindow* window = nullptr;  ///< nullptr: numbers are not limited
  Reassembly* reassembly = nullptr;        ///< nullptr: fragments of authentication are skipped
  [[nodiscard]] bool has(std::uint8_t flag) const { return (flags & flag) != 0; }
  [[nodiscard]] Reader reader() const { return {body, has(kLittleEndian)}; }
};

/// An entity id is four bytes in big-endian order, whatever the byte order of the submessage.
[[nodiscard]] std::uint32_t entity_id(Bytes bytes, std::size_t at);
/// True for a user's writer or reader, false for those that every participant has [DDSI-RTPS 2.5,
/// 9.3.1.2].
[[nodiscard]] bool is_users(std::uint32_t entity);

/// Calls use(id, offset of the id) for every parameter of the list that begins at `at`. Returns the
/// offset after the sentinel that ends the list. Returns nullopt if the length of a parameter is
/// not a multiple of four, as the standard requires [DDSI-RTPS 2.5, 9.4.2.11], or exceeds the list:
/// DDS implementations interpret such a list differently.
template <class Use>
std::optional<std::size_t> walk_parameters(const Reader& list, std::size_t at, Use use) {
  constexpr std::uint16_t kSentinel = 0x0001;
  for (; at + 4 <= list.size();) {
    const std::uint16_t id = list.u16(at);
    const std::size_t length = list.u16(at + 2);
    if (id == kSentinel) return length == 0 ? std::optional{at + 4} : std::nullopt;
    if (length % 4 != 0 || length > list.size() - at - 4) return std::nullopt;
    use(id, at);
    at += 4 + length;
  }
  return std::nullopt;
}

/// The contents of a DATA submessage, by offsets in its body.
struct DataLayout {
  std::size_t payload = 0;  ///< offset of the payload, after the inline QoS
  bool not_alive = false;   ///< the status states that the instance is disposed or unregistered
};

/// Finds the payload, and blanks the key hash of a user's sample. nullopt if the submessage does
/// not conform to the standard: Fast DDS could read its parameters at another offset.
[[nodiscard]] std::optional<DataLayout> read_data(const Submessage& data, bool users);

}  // namespace abbe::dds::rtps_message
