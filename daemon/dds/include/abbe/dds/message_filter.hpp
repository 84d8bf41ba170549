#pragma once
/// Removes from received RTPS messages what would crash Fast DDS. Any computer of the network can
/// send things that end a process with Debian's Fast DDS 2.9.1. With and without DDS Security:
/// - An announced TypeObject with a sequence of structs that Fast DDS does not know (Fast-DDS issue
///   3296). The topics of abbe need neither type parameters nor content filters nor data sharing:
///   in announcements the filter replaces their ids by an unused id, which every implementation
///   skips.
/// - Values of announcements, and messages of authentication, that state more elements or longer
///   text than they have: Fast DDS takes memory for all, or reads on behind them. An announcement
///   with one is left out. Fragments of messages of authentication are joined before the check.
/// - A statistics submessage (80h, specific to Fast DDS) with a length other than the one that Fast
///   DDS asserts. The filter cuts such a submessage off at the end of a message, as Fast DDS does
///   itself. No valid sender puts one elsewhere; a message with one elsewhere is dropped.
///
/// Without DDS Security, from any matched writer:
/// - A sample without content: an instance is disposed or unregistered. Fast DDS aborts if it cannot
///   find its key. abbe's subscribers do not need such samples; the filter replaces them by a GAP,
///   so that a reliable reader does not wait for them. Key hashes are blanked: Fast DDS then reads
///   the key from the content.
///   So are samples of another encapsulation than plain CDR.
/// - Fragments of samples, which Fast DDS checks insufficiently. A message of abbe fits into one
///   datagram, so the filter skips those of users' writers.
/// - A GAP of more numbers than any history covers, which Fast DDS marks one by one; GAPs and
///   samples of numbers that no reader can use yet, which it keeps (sequence_window.hpp). A heartbeat
///   that skips millions of numbers, which it counts one by one, is changed to skip fewer.
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

#include "abbe/dds/sequence_window.hpp"

namespace abbe::dds {

class FragmentJoiner;

/// Changes an RTPS message [DDSI-RTPS 2.5, 8.3.4, 9.4.5.4 and 9.4.2.11] in place. Returns how many
/// of its bytes may be passed to Fast DDS; 0: drop the message. Never reads beyond the message.
/// `secured`: the participant uses DDS Security. Then samples and time stamps behind a signature's
/// prefix are not changed: Fast DDS drops what a stranger puts there.
/// `window`: what the readers of this participant wait for; nullptr: numbers are not limited by it.
/// `joiner`: takes the fragments of messages of authentication. What it joins must be filtered, too,
/// and passed to Fast DDS. nullptr: they are skipped.
[[nodiscard]] std::size_t filter_message(std::span<std::uint8_t> message, bool secured = false,
                                         const SequenceWindow* window = nullptr,
                                         FragmentJoiner* joiner = nullptr) noexcept;

/// Wraps `low_level`: a transport that passes received messages through the filter to Fast DDS.
/// `window`: one for all transports of the participant; nullptr with DDS Security, which hides the
/// numbers from the filter, and strangers from the readers.
[[nodiscard]] std::shared_ptr<eprosima::fastdds::rtps::TransportDescriptorInterface>
with_message_filter(
    std::shared_ptr<eprosima::fastdds::rtps::TransportDescriptorInterface> low_level, bool secured,
    std::shared_ptr<SequenceWindow> window);

}  // namespace abbe::dds
