#include "abbe/subscriber/message_filter.hpp"

#include <algorithm>
#include <array>
#include <optional>
#include <utility>
#include <vector>

#include "abbe/subscriber/internal/fragment_reassembly.hpp"
#include "announced_values.hpp"
#include "announcement_check.hpp"
#include "protected_structure.hpp"
#include "submessage.hpp"

namespace abbe::dds {
namespace {

using namespace rtps_message;

constexpr std::size_t kInfoSourcePrefixAt = 8, kInfoSourceBytes = 20;
/// Entity ids of the writers that announce participants, writers and readers: kind c2, ids 0001,
/// 0003 and 0004.
constexpr std::uint32_t kParticipantsWriter = 0x000100c2, kPublicationsWriter = 0x000003c2,
                        kSubscriptionsWriter = 0x000004c2;
/// Entity ids of the writer of participant messages (liveliness), and of the writers of DDS
/// Security, whose messages may be fragments.
constexpr std::uint32_t kLivelinessWriter = 0x000200c2, kAuthenticationWriter = 0x000201c3,
                        kKeysWriter = 0xff0202c3;

/// The number that a reader waits for from the writer whose entity id is at `at`; nullopt: unknown.
std::optional<std::uint64_t> next_of(const Submessage& submessage, std::size_t at) {
  SequenceWindow::WriterGuid writer{};
  std::ranges::copy(submessage.header.subspan<kPrefixAt, kPrefixBytes>(), writer.begin());
  std::copy_n(submessage.body.begin() + static_cast<std::ptrdiff_t>(at), 4,
              writer.begin() + kPrefixBytes);
  return submessage.window->next_of(writer);
}

/// True if `number`, of the writer whose entity id is at `at`, is so near that a reliable reader
/// may keep it.
bool is_near(const Submessage& submessage, std::size_t at, std::uint64_t number,
             std::uint64_t ahead = SequenceWindow::kAhead) {
  if (submessage.window == nullptr) return true;
  return number < next_of(submessage, at).value_or(1) + ahead;
}

bool announces_endpoint(std::uint32_t writer) {
  return writer == kPublicationsWriter || writer == kSubscriptionsWriter;
}

/// True if Fast DDS can calculate with the sequence number at `at`: it asserts that the high word
/// is not the largest. A writer that sends a million samples a second reaches kMost in 146,000
/// years.
bool is_countable(const Submessage& submessage, std::size_t at) {
  constexpr std::uint64_t kMost = std::uint64_t{1} << 62;
  return at + 8 <= submessage.body.size() && submessage.reader().sequence_number(at) < kMost;
}

/// Replaces a DATA submessage by a GAP of its sequence number: a reliable reader counts the sample
/// as received, and its history does not change. If the submessage is too short for a GAP, it is
/// skipped.
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

/// True for the encapsulation of every message of abbe, 00 00 or 00 01 (the two byte orders).
/// Generated code throws an exception for another encapsulation.
bool is_plain_cdr(Bytes payload) {
  return payload[0] == 0 && payload[1] <= 1;
}

/// True if Fast DDS can read `payload` as a message of authentication.
bool is_readable_authentication(Bytes payload) {
  constexpr std::size_t kEncapsulationBytes = 4;
  return payload.size() >= kEncapsulationBytes && is_plain_cdr(payload) &&
         authentication_has_valid_lengths(payload.subspan(kEncapsulationBytes), payload[1] == 1);
}

/// Checks a DATA submessage. False: the message must be dropped.
bool check_data(const Submessage& data) {
  constexpr std::size_t kWriterAt = 8, kNumberAt = 12, kShortest = 20;
  constexpr std::size_t kShortestLivelinessPayload = 20;  // encapsulation, GUID prefix, kind
  if (data.body.size() < kShortest || !is_countable(data, kNumberAt)) return false;
  const std::uint32_t writer = entity_id(data.body, kWriterAt);
  if (writer == kParticipantsWriter) {
    const auto announcement = check_announcement(data);
    if (announcement == Announcement::Malformed) data.kind = kSkipped;
    return announcement != Announcement::DropMessage;
  }
  const bool users = is_users(writer);
  const std::uint64_t ahead = users ? SequenceWindow::kAhead : SequenceWindow::kAnnouncementsAhead;
  if (data.window != nullptr && (!users || next_of(data, kWriterAt)) &&
      !is_near(data, kWriterAt, data.reader().sequence_number(kNumberAt), ahead)) {
    data.kind = kSkipped;
    return true;
  }
  if (announces_endpoint(writer)) {
    const auto announcement = check_announcement(data);
    // A GAP replaces the announcement. If it were only skipped, the reader would wait for it and
    // not take later announcements.
    if (announcement == Announcement::Malformed) replace_by_gap(data);
    return announcement != Announcement::DropMessage;
  }

  const auto layout = read_data(data, users && !data.is_signed);
  if (!layout) return false;
  const std::size_t payload = data.body.size() - std::min(layout->payload, data.body.size());
  const bool sample = data.has(kWithData) && !data.has(kWithKey) && !layout->not_alive &&
                      payload >= 4 && is_plain_cdr(data.body.subspan(layout->payload));
  if (users && !sample && !data.is_signed) {
    if (is_near(data, kWriterAt, data.reader().sequence_number(kNumberAt)))
      replace_by_gap(data);
    else
      data.kind = kSkipped;
  } else if (data.has(kWithData | kWithKey)) {
    const bool short_liveliness =
        writer == kLivelinessWriter && payload < kShortestLivelinessPayload;
    if (payload == 0 || short_liveliness ||
        (writer == kAuthenticationWriter && !is_readable_authentication(data.body.last(payload))))
      data.kind = kSkipped;
  }
  return true;
}

/// True for a message of authentication. Requires a submessage that has passed the checks.
bool is_authentication(const Submessage& submessage) {
  return submessage.kind == kData && entity_id(submessage.body, 8) == kAuthenticationWriter;
}

/// Moves a message of authentication into a message of its own. Fast DDS drops the rest of a
/// message at the first signed submessage for which it has no key yet, and Cyclone DDS may send its
/// last message of authentication, which gives the key, after such a submessage.
void pass_alone(const Submessage& authentication) {
  std::vector<std::uint8_t> message(kHeaderBytes + kSubmessageHeaderBytes);
  std::ranges::copy(authentication.header, message.begin());
  message[kHeaderBytes] = authentication.kind;
  message[kHeaderBytes + 1] = authentication.flags;
  Reader(message, authentication.has(kLittleEndian))
      .put_u16(kHeaderBytes + 2, static_cast<std::uint16_t>(authentication.body.size()));
  message.insert(message.end(), authentication.body.begin(), authentication.body.end());
  authentication.reassembly->messages.push_back(std::move(message));
  authentication.kind = kSkipped;
}

/// Adds a fragment whose numbers have been checked.
void add_to(Reassembly& reassembly, const Submessage& fragment) {
  constexpr std::size_t kIdsAt = 4, kFragmentsAt = 20, kPayloadAt = 32;
  const Reader reader = fragment.reader();
  Fragment part{.header = {},
                .little_endian = fragment.has(kLittleEndian),
                .ids = fragment.body.subspan<kIdsAt, 16>(),
                .first = reader.u32(kFragmentsAt),
                .count = reader.u16(kFragmentsAt + 4),
                .size = reader.u16(kFragmentsAt + 6),
                .sample_size = reader.u32(kFragmentsAt + 8),
                .payload = fragment.body.subspan(kPayloadAt)};
  std::ranges::copy(fragment.header, part.header.begin());
  if (auto message = reassembly.fragments.add(part))
    reassembly.messages.push_back(*std::move(message));
}

/// Checks a fragment. Only messages of DDS Security that are sent before encryption may be
/// fragments, because a message of abbe fits into one DATA submessage. Fast DDS checks fragments
/// insufficiently: if the payload after their inline QoS is missing, it frees memory that is not
/// its own. Fragments of authentication are reassembled and then checked. A fragment of an
/// announcement cannot be checked alone; a GAP of its number lets the reader continue with later
/// announcements.
void check_fragment(const Submessage& fragment) {
  constexpr std::size_t kWriterAt = 8, kNumberAt = 12, kFragmentsAt = 20, kShortest = 32;
  const Bytes body = fragment.body;
  fragment.kind = kSkipped;
  if (body.size() < kShortest) return;
  const std::uint32_t writer = entity_id(body, kWriterAt);
  if (!is_countable(fragment, kNumberAt)) return;
  if (announces_endpoint(writer) && !fragment.is_signed &&
      is_near(fragment, kWriterAt, fragment.reader().sequence_number(kNumberAt),
              SequenceWindow::kAnnouncementsAhead))
    replace_by_gap(fragment);
  if (writer != kAuthenticationWriter && writer != kKeysWriter) return;
  constexpr std::uint16_t kToPayload = kShortest - kToInlineQos;
  const Reader reader = fragment.reader();
  if (fragment.has(kInlineQos | kWithData) || reader.u16(2) != kToPayload ||
      body.size() == kShortest)  // for a fragment, kWithData means "with key"
    return;

  const std::uint64_t first = reader.u32(kFragmentsAt), count = reader.u16(kFragmentsAt + 4),
                      size = reader.u16(kFragmentsAt + 6), sample = reader.u32(kFragmentsAt + 8);
  const bool whole = first > 0 && count > 0 && size > 0 && sample > 0 &&
                     (first - 1 + count) * size < sample + size && sample <= kLongestMessage;
  if (!whole) return;
  if (writer == kKeysWriter) {
    if (fragment.is_signed) fragment.kind = kDataFrag;
  } else if (fragment.reassembly != nullptr) {
    add_to(*fragment.reassembly, fragment);
  }
}

/// True if the gap is short. Fast DDS marks each number of a gap; a long gap would block it and
/// exhaust the memory. A history of abbe covers fewer numbers than kLongestGap. Numbers ahead of
/// the number that the reader waits for are kept by Fast DDS.
bool is_short_gap(const Submessage& gap) {
  constexpr std::size_t kWriterAt = 4, kStartAt = 8, kBaseAt = 16, kBitsAt = 24, kShortest = 28;
  constexpr std::uint64_t kLongestGap = 1024, kMostBits = 256;
  if (gap.body.size() < kShortest) return false;
  const Reader reader = gap.reader();
  const std::uint64_t start = reader.sequence_number(kStartAt),
                      base = reader.sequence_number(kBaseAt),
                      bits = std::min<std::uint64_t>(reader.u32(kBitsAt), kMostBits);
  return start < base && base - start <= kLongestGap && is_countable(gap, kBaseAt) &&
         is_near(gap, kWriterAt, base + bits - 1);
}

/// Limits the first number of a heartbeat. Fast DDS counts one by one up to this number. A distant
/// number is replaced by a nearer one: the writer repeats its heartbeat, and the reader comes
/// nearer each time.
void limit_heartbeat(const Submessage& heartbeat) {
  constexpr std::size_t kWriterAt = 4, kFirstAt = 8, kLastAt = 16;
  if (!is_countable(heartbeat, kFirstAt) || !is_countable(heartbeat, kLastAt)) {
    heartbeat.kind = kSkipped;
    return;
  }
  if (heartbeat.window == nullptr || heartbeat.is_signed) return;
  const std::uint64_t next = next_of(heartbeat, kWriterAt).value_or(1);
  Reader reader = heartbeat.reader();
  const std::uint64_t first = reader.sequence_number(kFirstAt);
  if (first <= next) return;
  const std::uint64_t allowed = heartbeat.window->take_skip(first - next);
  if (allowed < first - next) reader.put_sequence_number(kFirstAt, next + allowed);
}

/// True if the reader belongs to the kind of the writer. Fast DDS delivers to the reader that a
/// submessage names, also from an unknown writer; the content would then be checked as that of
/// another writer.
bool is_for_its_reader(const Submessage& submessage) {
  const bool is_data = submessage.kind == kData || submessage.kind == kDataFrag;
  const bool is_of_writer = is_data || submessage.kind == kHeartbeat || submessage.kind == kGap ||
                            submessage.kind == kHeartbeatFrag;
  if (!is_of_writer) return true;
  const std::size_t at = is_data ? 4 : 0;
  if (submessage.body.size() < at + 8) return false;
  const std::uint32_t reader = entity_id(submessage.body, at),
                      writer = entity_id(submessage.body, at + 4);
  if (writer == 0) return false;
  if (reader == 0) return true;
  if (is_users(writer)) return is_users(reader);
  // Writer and reader must have the same number; kinds c2 and c7, and kinds c3 and c4, belong
  // together.
  const std::uint32_t kind = (writer & 0xff) == 0xc2 ? 0xc7 : 0xc4;
  return reader == ((writer & 0xffff'ff00) | kind);
}

/// True if the submessage may be unsigned. With keys, Fast DDS 2.9 accepts samples without
/// signature as if the participant whose GUID they state had sent them. Announcements of
/// participants and authentication are sent before there are keys for signatures.
bool may_be_unsigned(const Submessage& submessage) {
  switch (submessage.kind) {
    case kData:
    case kDataFrag: {
      const std::uint32_t writer = entity_id(submessage.body, 8);
      return writer == kAuthenticationWriter ||
             (writer == kParticipantsWriter && submessage.kind == kData);
    }
    case kPad:
    case kInfoTimestamp:
    case kInfoSource:
    case kInfoReplyIp4:
    case kInfoDestination:
    case kInfoReply:
    case kSecureBody:
    case kSecurePrefix:
    case kSecurePostfix:
      return true;
    default:
      return false;
  }
}

/// Changes one submessage so that Fast DDS can read it. False: the message must be dropped.
bool check(const Submessage& submessage) {
  switch (submessage.kind) {
    case kData:
      return check_data(submessage);
    case kDataFrag:
      check_fragment(submessage);
      return true;
    case kHeartbeat:
      limit_heartbeat(submessage);
      return true;
    case kAckNack:  // offset of the base of the list
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
      // Time stamps are removed, so that the sample that arrives last is the newest. With them, a
      // sample dated in the future would keep all later samples of its instance out of the history,
      // and Fast DDS 2.9 leaks the memory of each sample that it does not add for this reason.
      if (!submessage.is_signed) submessage.flags |= kNoTimestamp;
      return true;
    default:
      return true;
  }
}

}  // namespace

std::size_t filter_message(std::span<std::uint8_t> message, Protection protection,
                           const SequenceWindow* window, Reassembly* reassembly) noexcept {
  if (message.size() < kHeaderBytes) return 0;
  ProtectedStructure structure;
  bool any_signed = false;
  std::array<std::uint8_t, kHeaderBytes> header{};
  std::copy_n(message.begin(), kHeaderBytes, header.begin());

  for (std::size_t at = kHeaderBytes; at + kSubmessageHeaderBytes <= message.size();) {
    const bool first = at == kHeaderBytes;
    std::uint8_t &kind = message[at], &flags = message[at + 1];
    std::size_t length = Reader(message, (flags & kLittleEndian) != 0).u16(at + 2);
    at += kSubmessageHeaderBytes;

    // A length of zero means "up to the end of the message", except for the two kinds of
    // submessages that may be empty.
    const bool open = length == 0 && kind != kPad && kind != kInfoTimestamp;
    if (open) length = message.size() - at;
    if (at + length > message.size()) return 0;
    const bool last = at + length == message.size();
    if (!last && length % 4 != 0) return 0;

    if (kind == kStatistics)
      return last && structure.is_complete() ? at - kSubmessageHeaderBytes : 0;
    const Bytes body = message.subspan(at, length);
    at += length;
    if (kind == kInfoSource && length >= kInfoSourceBytes)
      std::copy_n(body.begin() + kInfoSourcePrefixAt, kPrefixBytes, header.begin() + kPrefixAt);

    bool is_signed = false;
    if (protection != Protection::None) {
      const auto found = structure.next(kind, body, first, open);
      if (!found) return 0;
      is_signed = *found;
      any_signed |= is_signed;
    }
    const Submessage submessage{kind, flags, body, is_signed, header, window, reassembly};
    const bool passes =
        is_signed || (is_for_its_reader(submessage) &&
                      (protection != Protection::Messages || may_be_unsigned(submessage)));
    if (!passes)
      kind = kSkipped;
    else if (!check(submessage))
      return 0;
    else if (any_signed && !is_signed && reassembly != nullptr && is_authentication(submessage))
      pass_alone(submessage);
  }
  return structure.is_complete() ? message.size() : 0;
}

}  // namespace abbe::dds
