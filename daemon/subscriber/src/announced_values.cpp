#include "announced_values.hpp"

#include <cstddef>
#include <optional>

#include "rtps_fields.hpp"

namespace abbe::dds {
namespace {

/// Reads a value in CDR from the front to the end. Each function returns false if the item that it
/// reads does not fit into the rest of the value.
class Value {
 public:
  Value(std::span<const std::uint8_t> bytes, bool little_endian)
      : bytes_(bytes), reader_(bytes, little_endian) {}

  bool skip(std::size_t octets) {
    if (octets > bytes_.size() - at_) return false;
    at_ += octets;
    return true;
  }
  /// A text. The octet 0 at its end is included in the length.
  bool text() {
    const auto length = count();
    return length && *length > 0 && skip(*length) && bytes_[at_ - 1] == 0 && align();
  }
  bool octets() {
    const auto length = count();
    return length && skip(*length) && align();
  }
  bool shorts() {
    const auto length = count();
    return length && skip(std::size_t{2} * *length);
  }
  template <class Element>
  bool sequence(Element element) {
    const auto length = count();
    if (!length) return false;
    for (std::uint32_t i = 0; i < *length; ++i)  // each element takes 4 octets or more
      if (!element()) return false;
    return true;
  }
  bool texts() {
    return sequence([&] { return text(); });
  }
  bool properties() {
    return sequence([&] { return text() && text(); });
  }
  /// A token of DDS Security: class, properties, binary properties.
  bool token() {
    return text() && properties() && sequence([&] { return text() && octets(); });
  }
  [[nodiscard]] bool at_end() const { return at_ == bytes_.size(); }
  bool tokens() {
    return sequence([&] { return token(); });
  }

 private:
  std::optional<std::uint32_t> count() {
    const std::size_t from = at_;
    return skip(4) ? std::optional{reader_.u32(from)} : std::nullopt;
  }
  /// Skips to a multiple of four. The end of a value without padding also counts as aligned.
  bool align() { return skip((4 - at_ % 4) % 4) || at_ == bytes_.size(); }

  std::span<const std::uint8_t> bytes_;
  rtps_message::FieldReader<const std::uint8_t> reader_;
  std::size_t at_ = 0;
};

/// The length of the value of parameter `id`. nullopt: the length varies, or Fast DDS does not read
/// the parameter.
std::optional<std::size_t> fixed_length(std::uint16_t id) {
  constexpr std::size_t kKind = 4, kTime = 8, kLocator = 24, kGuid = 16;
  switch (id) {
    case 0x0015:  // version of the protocol
    case 0x0016:  // vendor
    case 0x0043:  // expects inline QoS
    case 0x0058:  // builtin endpoints
    case 0x0006:  // strength of the ownership
    case 0x001d:  // durability
    case 0x001f:  // ownership
    case 0x0025:  // destination order
    case 0x8005:  // positive ACKs
      return kKind;
    case 0x0002:  // lease
    case 0x0004:  // time-based filter
    case 0x0021:  // presentation
    case 0x0023:  // deadline
    case 0x0027:  // latency budget
    case 0x002b:  // lifespan
    case 0x1004:  // security of endpoint and participant
    case 0x1005:
      return kTime;
    case 0x001a:  // reliability
    case 0x001b:  // liveliness
      return kKind + kTime;
    case 0x001e:  // durability service
      return kTime + 5 * kKind;
    case 0x002f:  // locators
    case 0x0030:
    case 0x0031:
    case 0x0032:
    case 0x0033:
    case 0x0048:
      return kLocator;
    case 0x0050:  // GUID of participant and endpoint, key hash, GUID of the stored history
    case 0x005a:
    case 0x0070:
    case 0x8002:
      return kGuid;
    default:
      return std::nullopt;
  }
}

}  // namespace

bool has_valid_lengths(std::uint16_t id, std::span<const std::uint8_t> bytes, bool little_endian) {
  constexpr std::size_t kLongestText = 256;  // longest text that Fast DDS accepts
  if (const auto length = fixed_length(id)) return bytes.size() == *length;
  Value value(bytes, little_endian);
  switch (id) {
    case 0x0005:  // name of the topic
    case 0x0007:  // name of the type
    case 0x0062:  // name of the entity
      return bytes.size() <= kLongestText && value.text();
    case 0x002c:  // data of user, group, topic
    case 0x002d:
    case 0x002e:
      return value.octets() && value.at_end();
    case 0x0029:  // partitions
      return value.texts() && value.at_end();
    case 0x0059:  // properties; binary properties may follow, which Fast DDS does not read
      return value.properties();
    case 0x0073:  // data representations
      return value.shorts();
    case 0x1001:  // tokens of identity and permissions
    case 0x1002:
      return value.token() && value.at_end();
    default:
      return true;
  }
}

bool authentication_has_valid_lengths(std::span<const std::uint8_t> message, bool little_endian) {
  // The fixed part: two identities of messages, and the GUIDs of the destination, of its endpoint,
  // and of the endpoint of the source.
  constexpr std::size_t kFixed = 2 * 24 + 3 * 16;
  Value value(message, little_endian);
  return value.skip(kFixed) && value.text() && value.tokens();
}

}  // namespace abbe::dds
