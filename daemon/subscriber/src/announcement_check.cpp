#include "announcement_check.hpp"

#include <algorithm>
#include <array>

#include "announced_values.hpp"

namespace abbe::dds {
namespace {

using namespace rtps_message;

/// Longest announcement in bytes. Those of abbe have less than 1 kB, with a TypeObject several kB.
/// A foreign participant may announce thousands, with user data that Fast DDS keeps.
constexpr std::size_t kLongestAnnouncement = 16384;
/// Parameter of a participant: how long it counts as alive without a message (lease). The limit is
/// three times the longest usual interval of announcements (30 s). A participant that announced an
/// endless lease and left would stay in memory.
constexpr std::uint16_t kParticipantLease = 0x0002;
constexpr std::uint32_t kLongestLease_s = 100;
/// Parameters that the topics of abbe do not need and that crash Fast DDS or exhaust its memory:
/// TypeInformation, TypeObject, TypeIdentifier, content filter, data sharing (Fast DDS).
constexpr std::array<std::uint16_t, 5> kBlankedParameters{0x0075, 0x0072, 0x0069, 0x0035, 0x8006};
constexpr std::uint16_t kEndpointGuid = 0x005a;

void limit_lease(Reader& list, std::size_t offset) {
  constexpr std::size_t kToValue = 4, kLeaseBytes = 8;  // seconds, fraction
  // The comparison is unsigned: negative numbers, which mean an endless lease, are then large.
  if (list.u16(offset + 2) < kLeaseBytes || list.u32(offset + kToValue) < kLongestLease_s) return;
  list.put_u32(offset + kToValue, kLongestLease_s);
  list.put_u32(offset + kToValue + 4, 0);
}

}  // namespace

Announcement check_announcement(const Submessage& data) {
  constexpr std::size_t kToValue = 4;
  const Bytes body = data.body;
  if (body.size() > kLongestAnnouncement) return Announcement::Malformed;
  const auto layout = read_data(data, false);
  if (!layout) return Announcement::DropMessage;
  const std::size_t at = layout->payload;
  if (!data.has(kWithData | kWithKey)) return Announcement::Passes;
  if (at + 4 > body.size()) return Announcement::DropMessage;
  const bool little_endian = (body[at + 1] & 1) != 0;  // PL_CDR_LE is 00 03, PL_CDR_BE is 00 02

  Reader list(body, little_endian);
  bool valid = body[at] == 0 && (body[at + 1] == 2 || body[at + 1] == 3);
  const auto end = walk_parameters(list, at + 4, [&](std::uint16_t id, std::size_t offset) {
    if (std::ranges::find(kBlankedParameters, id) != kBlankedParameters.end())
      list.put_u16(offset, kUnusedParameterId);
    if (id == kParticipantLease) limit_lease(list, offset);
    const auto value = body.subspan(offset + kToValue, list.u16(offset + 2));
    valid = valid && has_valid_lengths(id, value, little_endian);
    if (id == kEndpointGuid)
      valid = valid && std::ranges::equal(value.first(kPrefixBytes),
                                          data.header.subspan(kPrefixAt, kPrefixBytes));
  });
  if (!end) return Announcement::DropMessage;
  return valid ? Announcement::Passes : Announcement::Malformed;
}

}  // namespace abbe::dds
