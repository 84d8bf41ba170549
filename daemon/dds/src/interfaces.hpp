#pragma once
/// The network interfaces a profile names and those that are up.

#include <fastdds/dds/domain/qos/DomainParticipantQos.hpp>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/dds/interface_address.hpp"

namespace abbe::dds {

/// The IPv4 addresses that the profile allows (interfaceWhiteList: Fast DDS 2.9 compares it with
/// addresses, not with names of interfaces); empty: all, or transports that are not UDP. Of QoS
/// whose transports are not wrapped yet.
[[nodiscard]] std::vector<std::string> white_list(
    const eprosima::fastdds::dds::DomainParticipantQos& qos);

/// Error Io: the profile names interfaces (interfaceWhiteList) and none of them is up with an IPv4
/// address and a carrier. Fast DDS would create a participant that sends and receives nothing.
[[nodiscard]] daemon::Result<void> interface_of_profile_is_up(
    const eprosima::fastdds::dds::DomainParticipantQos& qos);

/// IPv4 addresses of the interfaces that are up with a carrier, sorted: those Fast DDS uses.
[[nodiscard]] std::vector<InterfaceAddress> running_addresses();

}  // namespace abbe::dds
