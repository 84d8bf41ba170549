#pragma once
/// The quality of service (QoS) of every topic. Subscribers must request a compatible QoS, so it is
/// fixed in code and not in the XML profile, which a site may change. Pure.

#include <fastdds/dds/publisher/qos/DataWriterQos.hpp>
#include <fastdds/dds/subscriber/qos/DataReaderQos.hpp>

#include "abbe/messages/topics.hpp"

namespace abbe::dds {

[[nodiscard]] eprosima::fastdds::dds::DataWriterQos writer_qos(daemon::Topic topic);

/// The QoS that a subscriber should request. The liveliness lease on ModelState lets the subscriber
/// detect that abbe-dds has ended or hangs.
[[nodiscard]] eprosima::fastdds::dds::DataReaderQos reader_qos(daemon::Topic topic);

}  // namespace abbe::dds
