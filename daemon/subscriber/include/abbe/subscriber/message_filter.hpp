#pragma once
/// Removes from received RTPS messages what would crash Fast DDS. Any computer of the network can
/// send things that end a process with Debian's Fast DDS 2.9.1. With and without DDS Security:
/// - An announced TypeObject with a sequence of structs that Fast DDS does not know (Fast-DDS issue
///   3296). The topics of abbe need neither type parameters nor content filters nor data sharing:
///   in announcements the filter replaces their ids by an unused id, which every implementation
///   skips.
/// - Values of announcements, and messages of authentication, that state more elements or longer
///   text than they have: Fast DDS takes memory for all, or reads beyond the value. Such an
///   announcement is skipped. Fragments of messages of authentication are reassembled before the
///   check.
/// - Samples for a reader of another kind than their writer, whose content would not be checked.
/// - A statistics submessage (80h, specific to Fast DDS) with a length other than the one that Fast
///   DDS asserts. The filter cuts such a submessage off at the end of a message, as Fast DDS does
///   itself. No valid sender puts one elsewhere; a message with one elsewhere is dropped.
///
/// With DDS Security:
/// - Unsigned samples and heartbeats, which Fast DDS takes for those of the participant whose GUID
///   they state, if every message must be signed (Protection::Messages).
/// - Messages with another structure than that of DDS Security (protected_structure.hpp).
///
/// Without DDS Security, from any matched writer:
/// - A sample without content: an instance is disposed or unregistered. Fast DDS aborts if it
///   cannot find its key. abbe's subscribers do not need such samples; the filter replaces them by
///   a GAP, so that a reliable reader does not wait for them. Key hashes are blanked: Fast DDS then
///   reads the key from the content. So are samples of another encapsulation than plain CDR.
/// - Fragments of samples, which Fast DDS checks insufficiently. A message of abbe fits into one
///   datagram, so the filter skips those of users' writers.
/// - A GAP of more numbers than any history covers, which Fast DDS marks one by one; GAPs and
///   samples of numbers that no reader can use yet, which it keeps (sequence_window.hpp). A
///   heartbeat that skips millions of numbers, which it counts one by one, is changed to skip
///   fewer.
/// - Sequence numbers that Fast DDS cannot add to without an assertion.
/// - Time stamps: a sample dated in the future would keep later ones out of the history. The filter
///   takes all of them away; the readers have the time of reception.
/// - A message of liveliness that is too short.
///
/// Participant leases above 100 s are shortened: a stranger that announced an endless one, and
/// left, would stay in memory. Announcements of more than 16 kB are skipped.
///
/// The filter also drops messages with wrong lengths: a message passes only if its submessages
/// follow each other as the standard requires, and its announcements have their parameters
/// where the standard puts them. So the filter and Fast DDS read the same parameters.
///
/// The filter is between the socket and Fast DDS. Pure, except for the transport; one thread per
/// receive channel.

#include <fastdds/rtps/transport/ChainingTransportDescriptor.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "abbe/subscriber/sequence_window.hpp"

namespace abbe::dds {

class FragmentReassembly;

/// Which messages DDS Security signs.
enum class Protection {
  None,     ///< DDS Security is off
  Profile,  ///< by the governance of a site's profile, which the filter does not know
  Messages  ///< every message: the governance that `abbe dds keys` makes (rtps_protection_kind)
};

/// Messages of authentication that the filter takes out of the filtered message.
struct Reassembly {
  FragmentReassembly& fragments;
  /// Those that a fragment completed, and those behind a signed submessage. They must be filtered,
  /// too, and passed to Fast DDS behind the filtered message.
  std::vector<std::vector<std::uint8_t>> messages;
};

/// Changes an RTPS message [DDSI-RTPS 2.5, 8.3.4, 9.4.5.4 and 9.4.2.11] in place. Returns how many
/// of its bytes may be passed to Fast DDS; 0: drop the message. Never reads beyond the message.
/// `protection` of the participant. What is protected by a signature is not changed: Fast DDS drops
/// what a stranger puts there. With Protection::Messages nothing else passes but announcements of
/// participants and messages of authentication.
/// `window`: what the readers of this participant wait for; nullptr: numbers are not limited by it.
/// `reassembly`: of messages of authentication; nullptr: their fragments are skipped, and the whole
/// ones remain where they are.
[[nodiscard]] std::size_t filter_message(std::span<std::uint8_t> message,
                                         Protection protection = Protection::None,
                                         const SequenceWindow* window = nullptr,
                                         Reassembly* reassembly = nullptr) noexcept;

/// Wraps `low_level`: a transport that passes received messages through the filter to Fast DDS.
/// `window`: one for all transports of the participant; nullptr with DDS Security, which hides the
/// numbers from the filter, and strangers from the readers.
[[nodiscard]] std::shared_ptr<eprosima::fastdds::rtps::TransportDescriptorInterface>
with_message_filter(
    std::shared_ptr<eprosima::fastdds::rtps::TransportDescriptorInterface> low_level,
    Protection protection, std::shared_ptr<SequenceWindow> window);

}  // namespace abbe::dds
