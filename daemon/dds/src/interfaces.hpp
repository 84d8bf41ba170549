#pragma once
/// The network interfaces a profile names and those that are up.

#include <fastdds/dds/domain/qos/DomainParticipantQos.hpp>

#include "abbe/daemon/error.hpp"

namespace abbe::dds {

/// Error Io: the profile names interfaces (interfaceWhiteList) and none of them is up with an IPv4 address.
/// Who started us tries again; a participant would stay silent when the network comes.
[[nodiscard]] daemon::Result<void> interface_of_profile_is_up(
    const eprosima::fastdds::dds::DomainParticipantQos& qos);

}  // namespace abbe::dds
