#pragma once
/// Removes the parts of received RTPS messages that would crash Fast DDS. Any computer of the
/// network can send messages that end a process with Debian's Fast DDS 2.9.1. With and without DDS
/// Security the filter removes or changes:
/// - An announced TypeObject with a sequence of structs that Fast DDS does not know (Fast-DDS issue
///   3296). The topics of abbe need neither type parameters nor content filters nor data sharing:
///   in announcements the filter replaces their ids by an unused id, which every implementation
///   skips.
/// - Values of announcements, and messages of authentication, that state more elements or longer
///   text than they have: Fast DDS takes memory for all, or reads beyond the value. Such an
///   announcement is skipped. Fragments of messages of authentication are reassembled before the
///   check.
/// - Samples whose reader is of another kind than their writer, because their content would not be
///   checked.
/// - A statistics submessage (80h, specific to Fast DDS) with a length other than the one that Fast
///   DDS asserts. The filter cuts such a submessage off at the end of a message, as Fast DDS does
///   itself. A message with such a submessage elsewhere is dropped, because no valid sender creates
///   it.
///
/// With DDS Security also:
/// - Unsigned samples and heartbeats, which Fast DDS takes for those of the participant whose GUID
///   they state, if every message must be signed (Protection::Messages).
/// - Messages with another structure than that of DDS Security (protected_structure.hpp).
///
/// Without DDS Security also, from any matched writer:
/// - A sample without content: an instance is disposed or unregistered. Fast DDS aborts if it
///   cannot find its key. abbe's subscribers do not need such samples; the filter replaces them by
///   a GAP, so that a reliable reader does not wait for them. Key hashes are blanked, so that Fast
///   DDS reads the key from the content. Samples with an encapsulation other than plain CDR are
///   blanked as well.
/// - Fragments of samples, which Fast DDS checks insufficiently. Messages of abbe fit into one
///   datagram, so the filter skips fragments from users' writers.
/// - A GAP of more numbers than any history covers, which Fast DDS marks one by one; GAPs and
///   samples of numbers that no reader can use yet, which it keeps (sequence_window.hpp). A
///   heartbeat that skips millions of numbers, which it counts one by one, is changed to skip
///   fewer.
/// - Sequence numbers that Fast DDS cannot add to without an assertion.
/// - Time stamps: a sample dated in the future would keep later ones out of the history. The filter
///   removes all time stamps; readers use the time of reception.
/// - A message of liveliness that is too short.
///
/// Participant leases above 100 s are shortened: a foreign participant that announced an endless
/// lease and left would stay in memory. Announcements of more than 16 kB are skipped.
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

/// The messages that DDS Security signs.
enum class Protection {
  None,  ///< DDS Security is off
  /// messages as the governance of a site's profile states; the filter does not know which
  Profile,
  Messages  ///< every message: the governance that `abbe dds keys` makes (rtps_protection_kind)
};

/// Messages of authentication that the filter takes out of the message that it filters.
struct Reassembly {
  FragmentReassembly& fragments;
  /// Messages that a fragment has completed, and messages that followed a signed submessage. The
  /// caller must filter them, too, and pass them to Fast DDS after the filtered message.
  std::vector<std::vector<std::uint8_t>> messages;
};

/// Changes an RTPS message [DDSI-RTPS 2.5, 8.3.4, 9.4.5.4 and 9.4.2.11] in place. Returns how many
/// of its bytes may be passed to Fast DDS; 0: drop the message. Never reads beyond the message.
/// `protection` of the participant. Signed content is not changed, because Fast DDS drops forged
/// content there. With Protection::Messages, of the unsigned content only announcements of
/// participants and messages of authentication pass.
/// `window`: the sequence numbers that the readers of this participant wait for; nullptr: no limit
/// of numbers. `reassembly`: receives messages of authentication; nullptr: their fragments are
/// skipped, and whole ones stay in the message.
[[nodiscard]] std::size_t filter_message(std::span<std::uint8_t> message,
                                         Protection protection = Protection::None,
                                         const SequenceWindow* window = nullptr,
                                         Reassembly* reassembly = nullptr) noexcept;

/// Wraps `low_level`: a transport that passes received messages through the filter to Fast DDS.
/// `window`: one object for all transports of the participant. With DDS Security it is nullptr: the
/// numbers are then encrypted, and readers accept no foreign participants.
[[nodiscard]] std::shared_ptr<eprosima::fastdds::rtps::TransportDescriptorInterface>
with_message_filter(
    std::shared_ptr<eprosima::fastdds::rtps::TransportDescriptorInterface> low_level,
    Protection protection, std::shared_ptr<SequenceWindow> window);

}  // namespace abbe::dds
