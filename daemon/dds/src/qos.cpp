#include "abbe/dds/qos.hpp"

#include "abbe/dds/payload_type.hpp"

namespace abbe::dds {
namespace {

using namespace eprosima::fastdds::dds;
using eprosima::fastrtps::Duration_t;

/// Lease of the liveliness of ModelState. abbe-dds asserts the liveliness explicitly
/// (MANUAL_BY_TOPIC), and only while abbed is alive.
const Duration_t kLivelinessLease(1, 0);
/// Heartbeat period of durable writers. A late joiner receives old samples after the next
/// heartbeat; with Fast DDS's default period it would wait for up to 3 s.
const Duration_t kHeartbeatPeriod(0, 100'000'000);

/// Most instances of a topic. Fast DDS's default is 10, but a grid may have more slices and a
/// machine more streams.
constexpr int kMostInstances = 128;
/// Most writers or readers of other participants with which an endpoint is matched. Without a
/// limit, another participant that announces endpoints without end would exhaust the memory.
constexpr std::size_t kMostMatches = 512;
constexpr int kInstancesAtStart = 4;

bool is_durable(daemon::Topic topic) {
  return daemon::traits(topic).kind == daemon::TopicTraits::Kind::Durable;
}

/// Sets the policies that have the same place in the QoS types of writer and reader. The other
/// policies have the same values for writer and reader, but other places in the types.
template <class Qos>
void set_common(daemon::Topic topic, Qos& qos) {
  qos.reliability().kind =
      is_durable(topic) ? RELIABLE_RELIABILITY_QOS : BEST_EFFORT_RELIABILITY_QOS;
  qos.durability().kind =
      is_durable(topic) ? TRANSIENT_LOCAL_DURABILITY_QOS : VOLATILE_DURABILITY_QOS;
  qos.history().kind = KEEP_LAST_HISTORY_QOS;
  qos.history().depth = 1;
  qos.resource_limits().max_samples = kMostInstances;
  qos.resource_limits().max_instances = kMostInstances;
  qos.resource_limits().max_samples_per_instance = 1;
  qos.resource_limits().allocated_samples = kInstancesAtStart;
  qos.endpoint().history_memory_policy = eprosima::fastrtps::rtps::PREALLOCATED_MEMORY_MODE;
  qos.data_sharing().off();

  if (topic == daemon::Topic::ModelState) {
    qos.liveliness().kind = MANUAL_BY_TOPIC_LIVELINESS_QOS;
    qos.liveliness().lease_duration = kLivelinessLease;
  }
}

}  // namespace

DataWriterQos writer_qos(daemon::Topic topic) {
  DataWriterQos qos;
  set_common(topic, qos);
  qos.representation().m_value = {XCDR_DATA_REPRESENTATION};
  qos.reliable_writer_qos().times.heartbeatPeriod = kHeartbeatPeriod;
  qos.publish_mode().kind = SYNCHRONOUS_PUBLISH_MODE;
  qos.writer_resource_limits().matched_subscriber_allocation.maximum = kMostMatches;
  return qos;
}

DataReaderQos reader_qos(daemon::Topic topic) {
  DataReaderQos qos;
  set_common(topic, qos);
  // Two streams of a machine may share an instance, and both samples must stay until they are
  // taken. The depth is 1 for the other topics, because other participants may fill all places with
  // 64 kB each.
  const int depth = topic == daemon::Topic::Health ? 2 : 1;
  qos.history().depth = depth;
  qos.resource_limits().max_samples_per_instance = depth;
  // The history cannot become full: a sample of any sender has one of kReceivedInstances instances.
  qos.resource_limits().max_samples = kReceivedInstances * depth;
  qos.resource_limits().max_instances = kReceivedInstances;
  // Each sample allocates only the memory that it needs, because other participants may fill all
  // places.
  qos.endpoint().history_memory_policy =
      eprosima::fastrtps::rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
  qos.reader_resource_limits().matched_publisher_allocation.maximum = kMostMatches;
  qos.type_consistency().representation.m_value = {XCDR_DATA_REPRESENTATION};
  return qos;
}

}  // namespace abbe::dds
