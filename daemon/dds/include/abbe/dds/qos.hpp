#pragma once
/// The quality of service of every topic. It is the contract with the subscribers and therefore
/// fixed in code, not in the profile of the site. Pure.

#include <fastdds/dds/publisher/qos/DataWriterQos.hpp>
#include <fastdds/dds/subscriber/qos/DataReaderQos.hpp>

#include "abbe/messages/topics.hpp"

namespace abbe::dds {

[[nodiscard]] eprosima::fastdds::dds::DataWriterQos writer_qos(daemon::Topic topic);

/// The QoS that a subscriber should request. The lease on ModelState lets it detect an abbe-dds
/// that has ended or hangs.
[[nodiscard]] eprosima::fastdds::dds::DataReaderQos reader_qos(daemon::Topic topic);

}  // namespace abbe::dds
