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
constexpr std::size_t kLongestMessage = 65536;  // a UDP datagram
constexpr std::uint8_t kData = 0x15, kDataFrag = 0x16, kPad = 0x01, kInfoTimestamp = 0x09,
                       kAckNack = 0x06, kHeartbeat = 0x07, kGap = 0x08, kNackFrag = 0x12,
                       kHeartbeatFrag = 0x13, kSecurePrefix = 0x31, kSecureMessagePrefix = 0x33,
                       kSecureMessagePostfix = 0x34, kStatistics = 0x80;
constexpr std::uint8_t kLittleEndian = 0x01, kInlineQos = 0x02, kWithData = 0x04, kWithKey = 0x08,
                       kNoTimestamp = 0x02;
/// Replaces the kind of a submessage that must not be read. The kind is not assigned, so a receiver
/// skips the submessage [DDSI-RTPS 2.5, 9.4.5.1.1].
constexpr std::uint8_t kSkipped = 0x7f;
constexpr std::size_t kToInlineQos = 4;  // octetsToInlineQos counts from the end of its own field
/// Limits of octetsToInlineQos. Reader id, writer id and sequence number take 16 bytes; Fast DDS
/// replaces a smaller value by 16. Fast DDS reads a signed 16-bit number, hence the upper limit.
constexpr std::size_t kShortestToInlineQos = 16, kLongestToInlineQos = 0x7fff;

/// Entity ids of the writers that announce writers and readers: kind c2, ids 0003 and 0004.
constexpr std::uint32_t kPublicationsWriter = 0x000003c2, kSubscriptionsWriter = 0x000004c2;
/// Entity ids of the writer of participant messages (liveliness), and of the writers of DDS
/// Security, whose messages may be fragments.
constexpr std::uint32_t kLivelinessWriter = 0x000200c2, kAuthenticationWriter = 0x000201c3,
                        kKeysWriter = 0xff0202c3;
/// Key hash and status info (disposed, unregistered) of a sample.
constexpr std::uint16_t kKeyHash = 0x0070, kStatusInfo = 0x0071;
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
  [[nodiscard]] std::uint32_t u32(std::size_t at) const {
    const std::uint32_t a = u16(at), b = u16(at + 2);
    return little_endian_ ? a | b << 16 : a << 16 | b;
  }
  /// High word first, in either byte order.
  [[nodiscard]] std::uint64_t sequence_number(std::size_t at) const {
    return std::uint64_t{u32(at)} << 32 | u32(at + 4);
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

/// A user's writer or reader, not one of those that every participant has [DDSI-RTPS 2.5, 9.3.1.2].
bool is_users(std::uint32_t entity) {
  return (entity & 0xc0u) != 0xc0u;
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

/// A submessage, to be changed in place: its kind and flags in the header, and its body.
struct Submessage {
  std::uint8_t& kind;
  std::uint8_t& flags;
  Bytes body;
  /// Signed by DDS Security: a change would make the receiver drop it. Its sender is trusted.
  bool is_signed = false;
  [[nodiscard]] bool has(std::uint8_t flag) const { return (flags & flag) != 0; }
  [[nodiscard]] Reader reader() const { return {body, has(kLittleEndian)}; }
};

bool announces_endpoint(std::uint32_t writer) {
  return writer == kPublicationsWriter || writer == kSubscriptionsWriter;
}

/// What a DATA submessage contains, by offsets in its body.
struct DataLayout {
  std::size_t payload = 0;  ///< behind the inline QoS
  bool not_alive = false;   ///< the status says disposed or unregistered
};

/// Whether Fast DDS can calculate with the sequence number at `at`: it asserts that the high word is
/// not the largest. A writer that sends a million samples a second reaches kMost in 146,000 years.
bool is_countable(const Submessage& submessage, std::size_t at) {
  constexpr std::uint64_t kMost = std::uint64_t{1} << 62;
  return at + 8 <= submessage.body.size() && submessage.reader().sequence_number(at) < kMost;
}

/// Finds the payload, and blanks the key hash of a user's sample. nullopt if the submessage does not conform to the
/// standard: Fast DDS could read its parameters at another offset.
std::optional<DataLayout> read_data(const Submessage& data, bool users) {
  Reader reader = data.reader();
  const std::size_t to_inline_qos = reader.u16(2);
  if (to_inline_qos < kShortestToInlineQos || to_inline_qos > kLongestToInlineQos)
    return std::nullopt;
  DataLayout layout{.payload = kToInlineQos + to_inline_qos};
  if (!data.has(kInlineQos)) return layout;

  const auto end =
      walk_parameters(reader, layout.payload, [&](std::uint16_t id, std::size_t offset) {
        const std::size_t length = reader.u16(offset + 2);
        if (id == kStatusInfo && length > 0)  // four octets; the last one has the flags
          layout.not_alive |= data.body[offset + 4 + std::min<std::size_t>(length, 4) - 1] != 0;
        if (id == kKeyHash && users) reader.put_u16(offset, kUnusedParameterId);
      });
  if (!end) return std::nullopt;
  layout.payload = *end;
  return layout;
}

/// Replaces the ids of the type parameters by an unused id. False if the announcement does not
/// conform to the standard: the message must be dropped.
bool blank_types(const Submessage& data) {
  const Bytes body = data.body;
  const auto layout = read_data(data, false);
  if (!layout) return false;
  const std::size_t at = layout->payload;
  if (!data.has(kWithData | kWithKey)) return true;
  if (at + 4 > body.size()) return false;
  const bool little_endian = (body[at + 1] & 1) != 0;  // PL_CDR_LE is 00 03, PL_CDR_BE is 00 02
  Reader list(body, little_endian);

  const auto end = walk_parameters(list, at + 4, [&list](std::uint16_t id, std::size_t offset) {
    if (std::ranges::find(kTypeParameters, id) != kTypeParameters.end())
      list.put_u16(offset, kUnusedParameterId);
  });

  return end.has_value();
}

/// Replaces a DATA submessage by a GAP of its sequence number: a reliable reader counts the sample
/// as received, and its history does not change. Too short for a GAP: the submessage is skipped.
void replace_by_gap(const Submessage& data) {
  constexpr std::size_t kGapBytes = 28;  // reader, writer, start, base of the list, its 0 bits
  constexpr std::size_t kSequenceNumberAt = 12;
  data.kind = kSkipped;
  if (data.body.size() < kGapBytes) return;
  const bool little_endian = data.has(kLittleEndian);
  std::array<std::uint8_t, kGapBytes> gap{};
  std::copy_n(data.body.begin() + 4, 16, gap.begin());  // ids and sequence number

  // The list begins at the next number: high word, then low word.
  std::uint64_t next = 0;
  for (std::size_t i = 0; i < 8; ++i) {
    const std::size_t word = i / 4 * 4, byte = little_endian ? 3 - i % 4 : i % 4;
    next = next << 8 | data.body[kSequenceNumberAt + word + byte];
  }
  ++next;
  for (std::size_t i = 8; i-- > 0; next >>= 8) {
    const std::size_t word = i / 4 * 4, byte = little_endian ? 3 - i % 4 : i % 4;
    gap[16 + word + byte] = static_cast<std::uint8_t>(next & 0xff);
  }

  std::ranges::copy(gap, data.body.begin());
  data.kind = kGap;
  data.flags &= kLittleEndian;
}

/// The encapsulation of every message of abbe, in one of the two byte orders: 00 00 or 00 01.
/// Generated code throws at another one.
bool is_plain_cdr(Bytes payload) {
  return payload[0] == 0 && payload[1] <= 1;
}

/// False: the message must be dropped.
bool check_data(const Submessage& data) {
  constexpr std::size_t kWriterAt = 8, kNumberAt = 12, kShortest = 20;
  constexpr std::size_t kShortestLivelinessPayload = 20;  // encapsulation, GUID prefix, kind
  if (data.body.size() < kShortest || !is_countable(data, kNumberAt)) return false;
  const std::uint32_t writer = entity_id(data.body, kWriterAt);
  if (announces_endpoint(writer)) return blank_types(data);

  const bool users = is_users(writer);
  const auto layout = read_data(data, users && !data.is_signed);
  if (!layout) return false;
  const std::size_t payload = data.body.size() - std::min(layout->payload, data.body.size());
  const bool sample = data.has(kWithData) && !data.has(kWithKey) && !layout->not_alive &&
                      payload >= 4 && is_plain_cdr(data.body.subspan(layout->payload));
  if (users && !sample && !data.is_signed) {
    replace_by_gap(data);
  } else if (data.has(kWithData | kWithKey)) {
    const bool short_liveliness =
        writer == kLivelinessWriter && payload < kShortestLivelinessPayload;
    if (payload == 0 || short_liveliness) data.kind = kSkipped;
  }
  return true;
}

/// Only the messages of DDS Security before it encrypts may be fragments: a message of abbe fits
/// into one DATA submessage, and Fast DDS checks fragments insufficiently: without a payload behind
/// their inline QoS it frees memory that is not its own. A fragment of an announcement cannot be
/// checked alone.
void check_fragment(const Submessage& fragment) {
  constexpr std::size_t kWriterAt = 8, kFragmentsAt = 20, kShortest = 32;
  const Bytes body = fragment.body;
  fragment.kind = kSkipped;
  if (body.size() < kShortest) return;
  const std::uint32_t writer = entity_id(body, kWriterAt);
  if (writer != kAuthenticationWriter && writer != kKeysWriter) return;
  if (!is_countable(fragment, 12)) return;
  constexpr std::uint16_t kToPayload = kShortest - kToInlineQos;
  const Reader reader = fragment.reader();
  if (fragment.has(kInlineQos | kWithData) || reader.u16(2) != kToPayload ||
      body.size() == kShortest)  // of a fragment kWithData means "with key"
    return;

  const std::uint64_t first = reader.u32(kFragmentsAt), count = reader.u16(kFragmentsAt + 4),
                      size = reader.u16(kFragmentsAt + 6), sample = reader.u32(kFragmentsAt + 8);
  const bool whole = first > 0 && count > 0 && size > 0 && sample > 0 &&
                     (first - 1 + count) * size < sample + size && sample <= kLongestMessage;
  if (whole) fragment.kind = kDataFrag;
}

/// Fast DDS marks each number of a gap: a long one would stop it for ever, and need all memory. A
/// history of abbe covers fewer numbers than kLongestGap.
bool is_short_gap(const Submessage& gap) {
  constexpr std::size_t kStartAt = 8, kBaseAt = 16, kShortest = 28;
  constexpr std::uint64_t kLongestGap = 1024;
  if (gap.body.size() < kShortest) return false;
  const Reader reader = gap.reader();
  const std::uint64_t start = reader.sequence_number(kStartAt),
                      base = reader.sequence_number(kBaseAt);
  return start < base && base - start <= kLongestGap && is_countable(gap, kBaseAt);
}

/// Changes one submessage so that Fast DDS can read it. False: the message must be dropped.
bool check(const Submessage& submessage) {
  switch (submessage.kind) {
    case kData:
      return check_data(submessage);
    case kDataFrag:
      check_fragment(submessage);
      return true;
    case kHeartbeat:  // first and last number
      if (!is_countable(submessage, 8) || !is_countable(submessage, 16)) submessage.kind = kSkipped;
      return true;
    case kAckNack:  // base of the list
      if (!is_countable(submessage, 8)) submessage.kind = kSkipped;
      return true;
    case kGap:
      if (!is_short_gap(submessage)) submessage.kind = kSkipped;
      return true;
    case kNackFrag:
    case kHeartbeatFrag:
      if (!is_countable(submessage, 8) || is_users(entity_id(submessage.body, 4)))
        submessage.kind = kSkipped;
      return true;
    case kInfoTimestamp:
      // Without time stamps the sample that arrives last is the newest. With them a sample dated in
      // the future would keep all later ones of its instance out of the history, and Fast DDS 2.9
      // loses the memory of each sample that it does not add for this reason.
      if (!submessage.is_signed) submessage.flags |= kNoTimestamp;
      return true;
    default:
      return true;
  }
}

/// Passes the bytes of the low-level transport through the filter to Fast DDS.
class MessageFilter final : public rtps::ChainingTransport {
 public:
  MessageFilter(const rtps::ChainingTransportDescriptor& descriptor, bool secured)
      : ChainingTransport(descriptor),
        descriptor_(descriptor.low_level_descriptor),
        secured_(secured) {}

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
    // Twice the longest message: where Fast DDS reads up to a length that a message only states, it
    // stays within this buffer.
    thread_local std::vector<std::uint8_t> buffer(2 * kLongestMessage);
    if (size > kLongestMessage) return;
    std::copy_n(bytes, size, buffer.begin());
    const std::size_t passed = filter_message(std::span(buffer).first(size), secured_);
    if (passed > 0)
      next->OnDataReceived(buffer.data(), static_cast<std::uint32_t>(passed), local, remote);
  }

 private:
  std::shared_ptr<rtps::TransportDescriptorInterface> descriptor_;
  bool secured_;
};

struct FilterDescriptor final : rtps::ChainingTransportDescriptor {
  FilterDescriptor(std::shared_ptr<rtps::TransportDescriptorInterface> low_level, bool is_secured)
      : ChainingTransportDescriptor(std::move(low_level)), secured(is_secured) {}
  [[nodiscard]] rtps::TransportInterface* create_transport() const override {
    return new MessageFilter(*this, secured);
  }
  bool secured;
};

}  // namespace

std::size_t filter_message(std::span<std::uint8_t> message, bool secured) noexcept {
  if (message.size() < kHeaderBytes) return 0;
  // A signature covers the one submessage behind its prefix, or all between the prefix and the
  // postfix of a message. What follows has none.
  bool in_signed_message = false, next_is_signed = false;
  for (std::size_t at = kHeaderBytes; at + kSubmessageHeaderBytes <= message.size();) {
    std::uint8_t &kind = message[at], &flags = message[at + 1];
    std::size_t length = Reader(message, (flags & kLittleEndian) != 0).u16(at + 2);
    at += kSubmessageHeaderBytes;

    // A length of zero means "up to the end of the message", except for the two kinds of
    // submessages that may be empty.
    if (length == 0 && kind != kPad && kind != kInfoTimestamp) length = message.size() - at;
    if (at + length > message.size()) return 0;
    const bool last = at + length == message.size();
    if (!last && length % 4 != 0) return 0;

    if (kind == kStatistics) return last ? at - kSubmessageHeaderBytes : 0;
    const bool is_signed = in_signed_message || next_is_signed;
    next_is_signed = secured && kind == kSecurePrefix;
    if (kind == kSecureMessagePrefix) in_signed_message = secured;
    if (kind == kSecureMessagePostfix) in_signed_message = false;
    if (!check({kind, flags, message.subspan(at, length), is_signed})) return 0;
    at += length;
  }
  return message.size();
}

std::shared_ptr<rtps::TransportDescriptorInterface> with_message_filter(
    std::shared_ptr<rtps::TransportDescriptorInterface> low_level, bool secured) {
  return std::make_shared<FilterDescriptor>(std::move(low_level), secured);
}

}  // namespace abbe::dds
