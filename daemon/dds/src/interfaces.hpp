#pragma once
/// The network interfaces that a profile names, and those that are up.

#include <fastdds/dds/domain/qos/DomainParticipantQos.hpp>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/dds/interface_address.hpp"

namespace abbe::dds {

/// The IPv4 addresses that the profile allows, from interfaceWhiteList, which Fast DDS 2.9 compares
/// with addresses, not with names of interfaces. Empty if all are allowed, or if a transport is not
/// UDP. Call it before the transports are wrapped by with_message_filter().
[[nodiscard]] std::vector<std::string> white_list(
    const eprosima::fastdds::dds::DomainParticipantQos& qos);

/// Checks that the participant can communicate. Error Io if the profile names interfaces
/// (interfaceWhiteList), but none of them is up with an IPv4 address and a carrier: Fast DDS would
/// create a participant that neither sends nor receives.
[[nodiscard]] daemon::Result<void> interface_of_profile_is_up(
    const eprosima::fastdds::dds::DomainParticipantQos& qos);

/// IPv4 addresses of the interfaces that are up with a carrier, sorted. Fast DDS uses these
/// addresses.
[[nodiscard]] std::vector<InterfaceAddress> running_addresses();

}  // namespace abbe::dds
