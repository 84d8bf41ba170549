#pragma once
/// The quality of service of every topic: the contract with subscribers, hence in code and not in
/// the site's profile. Pure.

#include <fastdds/dds/publisher/qos/DataWriterQos.hpp>
#include <fastdds/dds/subscriber/qos/DataReaderQos.hpp>

#include "abbe/messages/topics.hpp"

namespace abbe::dds {

[[nodiscard]] eprosima::fastdds::dds::DataWriterQos writer_qos(daemon::Topic topic);

/// What a subscriber should ask for. Its lease on ModelState is what makes a dead or hung abbe-dds
/// visible.
[[nodiscard]] eprosima::fastdds::dds::DataReaderQos reader_qos(daemon::Topic topic);

}  // namespace abbe::dds
