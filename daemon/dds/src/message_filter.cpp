#include "abbe/dds/message_filter.hpp"

#include <fastdds/rtps/transport/ChainingTransport.h>

#include <algorithm>
#include <array>
#include <optional>
#include <utility>
#include <vector>

namespace abbe::dds {
namespace {

namespace rtps = eprosima::fastdds::rtps;
using Bytes = std::span<std::uint8_t>;

constexpr std::size_t kHeaderBytes = 20, kSubmessageHeaderBytes = 4;
constexpr std::uint8_t kData = 0x15, kDataFrag = 0x16, kPad = 0x01, kInfoTimestamp = 0x09,
                       kStatistics = 0x80;
constexpr std::uint8_t kLittleEndian = 0x01, kInlineQos = 0x02, kWithData = 0x04, kWithKey = 0x08;
constexpr std::size_t kToInlineQos = 4;  // octetsToInlineQos counts from the end of its own field
/// Limits of octetsToInlineQos. Reader id, writer id and sequence number take 16 bytes; Fast DDS
/// replaces a smaller value by 16. Fast DDS reads a signed 16-bit number, hence the upper limit.
constexpr std::size_t kShortestToInlineQos = 16, kLongestToInlineQos = 0x7fff;

/// Entity ids of the writers that announce writers and readers: kind c2, ids 0003 and 0004.
constexpr std::uint32_t kPublicationsWriter = 0x000003c2, kSubscriptionsWriter = 0x000004c2;
/// Parameters that announce a type: TypeInformation, TypeObject, TypeIdentifier.
constexpr std::array<std::uint16_t, 3> kTypeParameters{0x0075, 0x0072, 0x0069};
constexpr std::uint16_t kSentinel = 0x0001;
/// Replaces the ids of type parameters. This id is vendor-specific and has no bit "must
/// understand", so a receiver skips a parameter with it.
constexpr std::uint16_t kUnusedParameterId = 0xbfff;

class Reader {
 public:
  Reader(Bytes bytes, bool little_endian) : bytes_(bytes), little_endian_(little_endian) {}
  [[nodiscard]] std::uint16_t u16(std::size_t at) const {
    const unsigned a = bytes_[at], b = bytes_[at + 1];
    return static_cast<std::uint16_t>(little_endian_ ? a | b << 8 : a << 8 | b);
  }
  void put_u16(std::size_t at, std::uint16_t value) {
    const auto low = static_cast<std::uint8_t>(value & 0xff),
               high = static_cast<std::uint8_t>(value >> 8);
    bytes_[at] = little_endian_ ? low : high;
    bytes_[at + 1] = little_endian_ ? high : low;
  }
  [[nodiscard]] std::size_t size() const { return bytes_.size(); }

 private:
  Bytes bytes_;
  bool little_endian_;
};

/// An entity id is four bytes in big-endian order, whatever the byte order of the submessage.
std::uint32_t entity_id(Bytes bytes, std::size_t at) {
  std::uint32_t id = 0;
  for (std::size_t i = 0; i < 4; ++i) id = id << 8 | bytes[at + i];
  return id;
}

/// Calls use(id, offset of the id) for every parameter of the list that begins at `at`. Returns the
/// offset behind the sentinel that ends the list. Returns nullopt if the length of a parameter is
/// not a multiple of four, as the standard requires [DDSI-RTPS 2.5, 9.4.2.11], or exceeds the list:
/// DDS implementations interpret such a list differently.
template <class Use>
std::optional<std::size_t> walk_parameters(const Reader& list, std::size_t at, Use use) {
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

/// Whether `body`, a DATA or DATA_FRAG submessage without its header, announces an endpoint.
bool is_announcement(Bytes body) {
  // offset of the writer id, after extra flags, octetsToInlineQos and reader id
  constexpr std::size_t kWriterAt = 8;
  if (body.size() < kWriterAt + 4) return false;
  const std::uint32_t writer = entity_id(body, kWriterAt);
  return writer == kPublicationsWriter || writer == kSubscriptionsWriter;
}

/// Replaces the ids of the type parameters by an unused id. False if the announcement does not
/// conform to the standard: Fast DDS could read its parameters at another offset, so the message
/// must be dropped.
bool blank_types(Bytes body, std::uint8_t flags) {
  const Reader header(body, (flags & kLittleEndian) != 0);
  const std::size_t to_inline_qos = header.u16(2);
  if (to_inline_qos < kShortestToInlineQos || to_inline_qos > kLongestToInlineQos) return false;
  std::size_t at = kToInlineQos + to_inline_qos;

  if ((flags & kInlineQos) != 0) {
    const auto end = walk_parameters(header, at, [](std::uint16_t, std::size_t) {});
    if (!end) return false;
    at = *end;
  }

  if ((flags & (kWithData | kWithKey)) == 0) return true;
  if (at + 4 > body.size()) return false;
  const bool little_endian = (body[at + 1] & 1) != 0;  // PL_CDR_LE is 00 03, PL_CDR_BE is 00 02
  Reader list(body, little_endian);

  const auto end = walk_parameters(list, at + 4, [&list](std::uint16_t id, std::size_t offset) {
    if (std::ranges::find(kTypeParameters, id) != kTypeParameters.end())
      list.put_u16(offset, kUnusedParameterId);
  });

  return end.has_value();
}

/// Passes the bytes of the low-level transport through the filter to Fast DDS.
class MessageFilter final : public rtps::ChainingTransport {
 public:
  explicit MessageFilter(const rtps::ChainingTransportDescriptor& descriptor)
      : ChainingTransport(descriptor), descriptor_(descriptor.low_level_descriptor) {}

  rtps::TransportDescriptorInterface* get_configuration() override { return descriptor_.get(); }

  bool send(eprosima::fastrtps::rtps::SenderResource* sender,
            const eprosima::fastrtps::rtps::octet* bytes, uint32_t size,
            eprosima::fastrtps::rtps::LocatorsIterator* begin,
            eprosima::fastrtps::rtps::LocatorsIterator* end,
            const std::chrono::steady_clock::time_point& timeout) override {
    return sender->send(bytes, size, begin, end, timeout);
  }

  void receive(rtps::TransportReceiverInterface* next, const eprosima::fastrtps::rtps::octet* bytes,
               uint32_t size, const eprosima::fastrtps::rtps::Locator_t& local,
               const eprosima::fastrtps::rtps::Locator_t& remote) override {
    thread_local std::vector<std::uint8_t> message;
    message.assign(bytes, bytes + size);
    const std::size_t passed = filter_message(message);
    if (passed > 0)
      next->OnDataReceived(message.data(), static_cast<std::uint32_t>(passed), local, remote);
  }

 private:
  std::shared_ptr<rtps::TransportDescriptorInterface> descriptor_;
};

struct FilterDescriptor final : rtps::ChainingTransportDescriptor {
  using ChainingTransportDescriptor::ChainingTransportDescriptor;
  [[nodiscard]] rtps::TransportInterface* create_transport() const override {
    return new MessageFilter(*this);
  }
};

}  // namespace

std::size_t filter_message(std::span<std::uint8_t> message) noexcept {
  if (message.size() < kHeaderBytes) return 0;
  for (std::size_t at = kHeaderBytes; at + kSubmessageHeaderBytes <= message.size();) {
    const std::uint8_t kind = message[at], flags = message[at + 1];
    std::size_t length = Reader(message, (flags & kLittleEndian) != 0).u16(at + 2);
    at += kSubmessageHeaderBytes;

    // A length of zero means "up to the end of the message", except for the two kinds of
    // submessages that may be empty.
    if (length == 0 && kind != kPad && kind != kInfoTimestamp) length = message.size() - at;
    if (at + length > message.size()) return 0;
    const bool last = at + length == message.size();
    if (!last && length % 4 != 0) return 0;

    const Bytes body = message.subspan(at, length);
    if (kind == kStatistics) return last ? at - kSubmessageHeaderBytes : 0;
    if (kind == kDataFrag && is_announcement(body)) return 0;  // a fragment cannot be checked alone
    if (kind == kData && is_announcement(body) && !blank_types(body, flags)) return 0;
    at += length;
  }
  return message.size();
}

std::shared_ptr<rtps::TransportDescriptorInterface> with_message_filter(
    std::shared_ptr<rtps::TransportDescriptorInterface> low_level) {
  return std::make_shared<FilterDescriptor>(std::move(low_level));
}

}  // namespace abbe::dds
