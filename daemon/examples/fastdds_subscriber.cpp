// How to apply abbe's correction, with Fast DDS and the types fastddsgen makes of abbe_v1.idl:
//   fastdds_subscriber DOMAIN [PROFILES.xml]
// prints for every Compensation whether it may be applied. Fast DDS calls the listener from one thread of its
// own.
#include <unistd.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <mutex>
#include <string>

#include "abbe_v1PubSubTypes.h"

using namespace eprosima::fastdds::dds;
using abbe::v1::Compensation;
using abbe::v1::ModelState;

namespace {

/// How long a vector has waited for us: the listener's lock, and whatever else kept this thread.
std::int64_t waited_ns(const SampleInfo& info) {
  eprosima::fastrtps::Time_t now;
  eprosima::fastrtps::Time_t::now(now);
  return now.to_ns() - info.reception_timestamp.to_ns();
}

/// The rule of abbe_v1.idl. `answered_for`: a writer of ModelState keeps its lease; `age_ns`: with our own
/// waiting.
const char* why_not(const Compensation& c, std::int64_t age_ns, const ModelState& state, bool answered_for) {
  if (!answered_for) return "nobody answers for the model";
  if (state.state() != abbe::v1::MODEL_ACTIVE || c.state() != abbe::v1::MODEL_ACTIVE)
    return "the model is not ACTIVE";
  if (c.model_id() != state.model_id()) return "the vector is of another model";
  if (!c.inside()) return "outside the volume the data covered";
  if (!c.tool_ok()) return "the model does not hold for this tool";
  if (age_ns > c.validity_ns()) return "too old";
  return nullptr;
}

class Listener : public DataReaderListener {
  void on_liveliness_changed(DataReader*, const LivelinessChangedStatus& status) override {
    const std::lock_guard lock(mutex_);
    answered_for_ = status.alive_count > 0;
    std::printf("answered_for %d\n", answered_for_ ? 1 : 0);
  }

  void on_data_available(DataReader* reader) override {
    const std::lock_guard lock(mutex_);
    const bool is_state = reader->get_topicdescription()->get_name() == "abbe/v1/ModelState";
    SampleInfo info;
    const auto ok = ReturnCode_t::RETCODE_OK;
    Compensation c;
    while (is_state && reader->take_next_sample(&state_, &info) == ok) {
      if (info.valid_data)
        std::printf("state %u %s\n", static_cast<unsigned>(state_.state()), state_.reason().c_str());
    }
    while (!is_state && reader->take_next_sample(&c, &info) == ok) {
      if (info.valid_data) decide(c, c.age_ns() + waited_ns(info));
    }
  }

  void decide(const Compensation& c, std::int64_t age_ns) {
    if (const char* reason = why_not(c, age_ns, state_, answered_for_)) {
      std::printf("do not apply: %s\n", reason);
    } else {
      std::printf("apply V = %.3f %.3f %.3f um\n", c.vector_m()[0] * 1e6, c.vector_m()[1] * 1e6,
                  c.vector_m()[2] * 1e6);
    }
  }

  std::mutex mutex_;
  ModelState state_;
  bool answered_for_ = false;
};

/// Without these two calls Fast DDS announces a TypeObject, which Cyclone DDS does not take and older Fast
/// DDS may not survive.
TypeSupport quiet(TopicDataType* type) {
  type->auto_fill_type_information(false);
  type->auto_fill_type_object(false);
  return TypeSupport(type);
}

bool read_topic(DomainParticipant* participant, Subscriber* subscriber, TypeSupport type,
                const char* topic_name, const DataReaderQos& qos, DataReaderListener* listener) {
  type.register_type(participant);
  Topic* topic = participant->create_topic(topic_name, type.get_type_name(), TOPIC_QOS_DEFAULT);
  return topic != nullptr && subscriber->create_datareader(topic, qos, listener) != nullptr;
}

}  // namespace

int main(int argc, char** argv) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  auto* factory = DomainParticipantFactory::get_instance();
  DomainParticipantQos participant_qos;
  if (argc > 2 &&
      (factory->load_XML_profiles_file(argv[2]) != ReturnCode_t::RETCODE_OK ||
       factory->get_participant_qos_from_profile("abbe", participant_qos) != ReturnCode_t::RETCODE_OK)) {
    return 3;
  }
  auto* participant =
      factory->create_participant(argc > 1 ? static_cast<unsigned>(std::atoi(argv[1])) : 0, participant_qos);
  if (participant == nullptr) return 4;
  static Listener listener;
  auto* subscriber = participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT);

  DataReaderQos live;  // best effort, volatile, keep last 1
  DataReaderQos durable;
  durable.reliability().kind = RELIABLE_RELIABILITY_QOS;
  durable.durability().kind = TRANSIENT_LOCAL_DURABILITY_QOS;
  durable.liveliness().kind =
      MANUAL_BY_TOPIC_LIVELINESS_QOS;  // abbe-dds asserts it only while abbed is alive
  durable.liveliness().lease_duration = eprosima::fastrtps::Duration_t(1, 0);

  const bool ok = read_topic(participant, subscriber, quiet(new abbe::v1::ModelStatePubSubType),
                             "abbe/v1/ModelState", durable, &listener) &&
                  read_topic(participant, subscriber, quiet(new abbe::v1::CompensationPubSubType),
                             "abbe/v1/Compensation", live, &listener);
  if (!ok) return 4;
  std::puts("waiting; end with Ctrl-C");
  for (;;) ::pause();
}
