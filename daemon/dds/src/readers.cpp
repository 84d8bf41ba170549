#include "abbe/dds/readers.hpp"

#include <fastdds/dds/core/condition/StatusCondition.hpp>
#include <fastdds/dds/core/condition/WaitSet.hpp>
#include <fastdds/dds/core/status/LivelinessChangedStatus.hpp>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>

#include <string>
#include <utility>
#include <vector>

#include "abbe/dds/payload_type.hpp"
#include "abbe/dds/qos.hpp"

namespace abbe::dds {
namespace {

namespace fast = eprosima::fastdds::dds;
const auto kOk = eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK;

}  // namespace

struct Readers::State {
  struct Reader {
    daemon::Topic topic;
    fast::DataReader* reader;
  };
  std::vector<Reader> readers;
  fast::DataReader* model_state = nullptr;
  fast::WaitSet waiting;
  fast::ConditionSeq active;
  Payload payload;

  ~State() {
    for (const Reader& r : readers) waiting.detach_condition(r.reader->get_statuscondition());
  }

  void add(daemon::Topic topic, fast::DataReader* reader) {
    auto& condition = reader->get_statuscondition();
    condition.set_enabled_statuses(fast::StatusMask::data_available()
                                   << fast::StatusMask::liveliness_changed());
    waiting.attach_condition(condition);
    readers.push_back({topic, reader});
    if (topic == daemon::Topic::ModelState) model_state = reader;
  }
};

Readers::Readers(std::unique_ptr<State> state) : state_(std::move(state)) {}
Readers::Readers(Readers&&) noexcept = default;
Readers& Readers::operator=(Readers&&) noexcept = default;
Readers::~Readers() = default;

Result<Readers> Readers::create(Participant& participant, std::span<const daemon::Topic> topics) {
  auto* subscriber = participant.get().create_subscriber(fast::SUBSCRIBER_QOS_DEFAULT);
  if (subscriber == nullptr) return fail(ErrorCode::Io, "subscriber: Fast DDS refuses it");
  auto state = std::make_unique<State>();
  for (const daemon::Topic t : topics) {
    const auto topic = participant.topic(t);
    if (!topic) return tl::make_unexpected(topic.error());
    auto* reader = subscriber->create_datareader(*topic, reader_qos(t));
    if (reader == nullptr) {
      return fail(ErrorCode::Io,
                  "reader of " + std::string(daemon::traits(t).name) + ": Fast DDS refuses it");
    }
    state->add(t, reader);
  }
  return Readers(std::move(state));
}

void Readers::wait(std::chrono::milliseconds at_most) {
  state_->waiting.wait(state_->active,
                       eprosima::fastrtps::Duration_t(static_cast<double>(at_most.count()) / 1e3));
}

void Readers::take(const OnPayload& on_payload) {
  for (const State::Reader& r : state_->readers) {
    fast::SampleInfo info;
    while (r.reader->take_next_sample(&state_->payload, &info) == kOk) {
      if (info.valid_data) on_payload(r.topic, state_->payload.bytes);
    }
  }
}

bool Readers::state_is_answered_for() const {
  if (state_->model_state == nullptr) return false;
  fast::LivelinessChangedStatus status;
  return state_->model_state->get_liveliness_changed_status(status) == kOk && status.alive_count > 0;
}

}  // namespace abbe::dds
