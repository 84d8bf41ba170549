#pragma once
/// Keeps from Fast DDS what would end it. Two things that anyone can send, with and without DDS
/// Security, end every process with Debian's Fast DDS 2.9.1:
/// - an announced TypeObject with a sequence of structs that it does not know (Fast-DDS issue 3296). abbe's
///   topics need no types: in endpoint announcements their parameters get an identifier without meaning,
///   which every implementation skips.
/// - a statistics submessage (80h, of Fast DDS alone) whose length is not the one it asserts. One at the end
///   is cut off, as Fast DDS does itself; elsewhere there is no honest one.
/// Besides, lengths that lie: only messages pass whose submessages follow each other as the standard has
/// them, and whose endpoint announcements hold their parameters where the standard has them, so that the
/// filter and Fast DDS see the same ones. The filter stands between the socket and Fast DDS. Pure, but for the
/// transport; one thread a receive channel.

#include <fastdds/rtps/transport/ChainingTransportDescriptor.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

namespace abbe::dds {

/// Changes an RTPS message [DDSI-RTPS 2.5, 8.3.4, 9.4.5.4 and 9.4.2.11] in place. How many of its
/// bytes may be handed on; 0: none. Never reads beyond it.
[[nodiscard]] std::size_t filter_message(std::span<std::uint8_t> message) noexcept;

/// The same transport with the filter in front.
[[nodiscard]] std::shared_ptr<eprosima::fastdds::rtps::TransportDescriptorInterface>
with_message_filter(
    std::shared_ptr<eprosima::fastdds::rtps::TransportDescriptorInterface> low_level);

}  // namespace abbe::dds
